"""surface.head.model.rounding: skin and clothes whose outlines are round in large pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_head import KNOTS, save_small_head, small_head

from controller.base.paths import find_config
from surface import DCPSurface
from surface.head import Head, save_data
from surface.head.model.file import load_data
from surface.head.model.light import LightPoints
from surface.head.model.look import Look, Worn
from surface.head.model.meshes import make_surface
from surface.head.model.rounding import with_rounder_outlines
from surface.head.model.wardrobe import DRAWN, carried, read_garment, with_garments
from surface.head.posing.part import HeadPart

CHORD_MM = 0.02


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A head of two curved patches with stored meshes."""
    return save_small_head(tmp_path)


def farthest_mm(part: HeadPart) -> float:
    """How far the middle of an edge lies from the surface, where two of the part's own triangles share it."""
    places, _, _ = part.surface.derivatives(part.mesh.uv, side=part.mesh.side)
    own = part.triangles[(part.triangles < len(part.mesh.uv)).all(axis=1)]
    return farthest_middle(part.surface, part.mesh.uv, places, own)


def farthest_middle(
    surface: DCPSurface, uv: np.ndarray, places: np.ndarray, triangles: np.ndarray, least: int = 2
) -> float:
    """How far the middle of an edge of ``least`` triangles (t, 3) lies from the surface; uv (m, 2), places (m, 3)."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    inner = unique[count >= least]
    middle = surface.evaluate(uv[inner].mean(axis=1))
    return float(np.linalg.norm(middle - places[inner].mean(axis=1), axis=1).max())


def test_skin_lies_as_near_to_its_surface_as_is_asked_for(folder: Path) -> None:
    plain, round_ = Head.load(folder), Head.load(folder, chord_mm=CHORD_MM)
    for head in (plain, round_):
        head.pose(head.values({}))
    for name in ("a", "b"):
        before, after = plain.part(name), round_.part(name)
        assert farthest_mm(before) > 2 * CHORD_MM >= 2 * farthest_mm(after)
        count = len(before.mesh.uv)
        assert np.array_equal(after.mesh.uv[:count], before.mesh.uv) and len(after.borders) == len(before.borders)
        assert len(after.triangles) > 2 * len(before.triangles)


def test_what_was_not_asked_for_is_not_done(folder: Path) -> None:
    plain, same = Head.load(folder), Head.load(folder, chord_mm=0.5)
    assert [len(p.vertices) for p in plain.parts] == [len(p.vertices) for p in same.parts]


def test_only_skin_becomes_rounder(folder: Path) -> None:
    data = small_head()
    save_data(folder, replace(data, parts=[replace(data.parts[0], material="teeth"), *data.parts[1:]]))
    plain, round_ = Head.load(folder), Head.load(folder, chord_mm=CHORD_MM)
    counts = [(len(p.mesh.uv), len(q.mesh.uv)) for p, q in zip(plain.parts, round_.parts, strict=True)]
    assert counts[0][0] == counts[0][1] and counts[1][0] < counts[1][1]


def test_new_vertices_move_as_the_surface_does(folder: Path) -> None:
    head = Head.load(folder, chord_mm=CHORD_MM)
    head.pose(head.values({"mouthPucker": 1.0}))
    part = head.part("a")
    data = next(each for each in head.data.parts if each.name == "a")
    moved = DCPSurface.from_padded(
        part.control_points, data.weights, data.knots_u, data.knots_v, data.degrees[:, 0], data.degrees[:, 1]
    )
    wanted = moved.evaluate(part.mesh.uv)
    assert np.abs(part.vertices[: len(wanted)] - wanted).max() < 1e-4
    assert np.abs(wanted - part.surface.evaluate(part.mesh.uv)).max() > 1.0


def test_round_skin_may_have_added_points_too(folder: Path) -> None:
    light = LightPoints("a", np.linspace(0.4, 0.6, 5)[None], np.linspace(0.4, 0.6, 5)[None])
    only, both = Head.load(folder, light=[light]), Head.load(folder, light=[light], chord_mm=CHORD_MM)
    for head in (only, both):
        head.pose(head.values({}))
    count = len(only.part("a").mesh.uv)
    assert np.abs(both.part("a").vertices[:count] - only.part("a").vertices[:count]).max() < 1e-4
    assert farthest_mm(both.part("a")) <= CHORD_MM < farthest_mm(only.part("a"))
    assert both.part("a").surface.n == len(KNOTS[:5]) ** 2 + 1


def test_clothes_become_rounder_and_stay_dressed() -> None:
    shirt = read_garment(Worn(find_config("wardrobe", "clothes-shirt.npz"), (0.2, 0.2, 0.2)))
    data = with_garments(load_data(find_config("heads", "ict")), (shirt,), "there")
    cloth = next(part for part in data.parts if part.material == "cloth")
    round_, finer = with_rounder_outlines(replace(data, parts=[cloth]), 0.05, {}, lambda name, mesh: {})

    surface = make_surface(cloth)

    def away_mm(mesh: Mapping[str, np.ndarray]) -> float:
        uv = mesh["mesh_uv"]
        places, along, _ = surface.derivatives(uv, side=mesh["mesh_side"])
        assert np.linalg.norm(along, axis=1).min() > 0.1, "vertices of a border are taken from its side"
        return farthest_middle(surface, uv, places, mesh["mesh_triangles"], least=1)

    assert away_mm(cloth.mesh) > 4.0 and away_mm(round_.parts[0].mesh) <= 0.05

    (before,), (after,) = shirt.parts, carried(shirt, finer).parts
    count = len(before.arrays["strands"])
    ends = finer[cloth.name].ends
    for key in DRAWN:
        values = np.asarray(after.arrays[key], float)
        assert len(values) == len(round_.parts[0].mesh["mesh_uv"]) and np.array_equal(
            after.arrays[key][:count], before.arrays[key]
        )
        assert np.abs(values[count:] - values[ends].mean(axis=1)).max() <= 1.0, "rounded to whole numbers"
    assert np.abs(after.arrays["strands"][count:] - after.arrays["strands"][ends].mean(axis=1)).max() < 1e-5
    hair = replace(before, name="hair")
    assert carried(replace(shirt, parts=(hair,)), finer).parts == (hair,), "no mesh of it became finer"


@pytest.mark.slow
def test_a_dressed_head_is_posed_with_round_clothes() -> None:
    """At the end of a garment's patch the surface is that before it: after it there is nothing."""
    look = Look(melanin=0.5, worn=(Worn(find_config("wardrobe", "clothes-shirt.npz"), (0.2, 0.2, 0.2)),))
    head = Head.load(find_config("heads", "ict"), look=look, chord_mm=0.05)
    head.pose(head.values({}))
    cloth = head.part("clothes")
    assert farthest_mm(cloth) <= 0.05 and np.isfinite(cloth.normals).all()


@pytest.mark.slow
def test_the_shipped_skull_is_round_and_keeps_paint_shade_and_fewer_triangles() -> None:
    folder = find_config("heads", "ict")
    plain, round_ = Head.load(folder), Head.load(folder, chord_mm=0.1)
    for head in (plain, round_):
        head.pose(head.values({}))
    before, after = plain.part("face"), round_.part("face")
    count = len(before.mesh.uv)
    assert farthest_mm(before) > 0.2 and farthest_mm(after) <= 0.1
    assert before.attributes.keys() == after.attributes.keys()
    for name, values in before.attributes.items():
        assert np.array_equal(after.attributes[name][:count], values[:count]), name
        new = after.attributes[name][count : len(after.mesh.uv)]
        assert np.isfinite(new).all() and new.min() >= values.min() - 1e-3 and new.max() <= values.max() + 1e-3, name
    for level, triangles in before.decimated.items():
        assert len(after.decimated[level]) == len(triangles)
