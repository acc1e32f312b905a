"""What lines the mouth is a part of its own, told by the jaw and by what hides it."""

from dataclasses import replace

import numpy as np
import pytest
from bag_head import bag, sphere

from surface.fit.features.cavity import CHORD_MM, POINTS, SPARE, line_mouth
from surface.fit.features.generic import make_plan
from surface.fit.source import regions
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh
from surface.fit.source.regions import own_corners

NONE = np.zeros(0, np.int64)
OUTER = len(sphere().vertices)


@pytest.fixture(autouse=True)
def fewer_views(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regions, "VIEWS", 36)
    monkeypatch.setattr(regions, "PIXELS", 160)


def head() -> FitMesh:
    """The ball with a bag for a mouth; jawOpen takes along what lies below the mouth's middle in front, a quarter of
    it in the bag's end."""
    mesh = bag(115.0)
    x, y, z = mesh.vertices.T
    share = ((y < -30) & (z > -20)) * np.clip(0.25 + (z - 0.0) / 30.0, 0.25, 1.0)
    jaw = np.column_stack([0 * x, -12.0 * share, 0 * x])
    return replace(mesh, names=("jawOpen",), deltas=jaw[None])


def islands_of(mesh: FitMesh, *groups: np.ndarray) -> list[Island]:
    return [own_corners(mesh, g) for g in groups]


def lined(mesh: FitMesh) -> np.ndarray:
    """(f,) faces of the bag."""
    return (mesh.faces[:, :3] >= OUTER).any(axis=1)


def test_a_hidden_island_between_the_lips_lines_the_mouth() -> None:
    mesh = head()
    inner = lined(mesh)
    every = np.arange(len(mesh.faces))
    assert line_mouth(mesh, islands_of(mesh, every[~inner], every[inner]), every, NONE) == [False, True]
    still = replace(mesh, names=(), deltas=mesh.deltas[:0])
    assert line_mouth(still, islands_of(mesh, every[~inner], every[inner]), every, NONE) == [False, False]
    assert line_mouth(mesh, islands_of(mesh, every), every, NONE) == [False]


def test_an_island_between_the_lips_that_is_seen_is_skin() -> None:
    mesh = head()
    out = mesh.vertices.copy()
    out[OUTER:, 2] = 160.0 - out[OUTER:, 2]  # the bag turned out of the mouth
    turned_out = replace(
        mesh, vertices=out, faces=np.where(lined(mesh)[:, None], mesh.faces[:, [0, 2, 1, 3]], mesh.faces)
    )
    every, inner = np.arange(len(mesh.faces)), lined(mesh)
    assert line_mouth(turned_out, islands_of(turned_out, every[~inner], every[inner]), every, NONE) == [False, False]


def test_what_hangs_together_with_a_lining_inside_the_head_belongs_to_it() -> None:
    mesh = head()
    every, inner = np.arange(len(mesh.faces)), lined(mesh)
    z = mesh.vertices[mesh.faces[:, :3]].mean(axis=1)[:, 2]
    end = inner & (z < -25)  # nothing of it moves as far as the chin
    front, back = every[~inner & (z > -20)], every[~inner & (z <= -20)]
    groups = islands_of(mesh, front, every[inner & ~end], every[end], back)
    assert line_mouth(mesh, groups, every, NONE) == [False, True, True, False]


def test_a_plan_has_the_lining_as_a_cavity_with_the_look_of_a_mouth() -> None:
    parts = {p.name: (p, islands) for p, islands in make_plan(head()).parts}
    assert (
        parts["cavity"][0].material == "mouth" and parts["cavity"][0].request.points < parts["face"][0].request.points
    )
    assert next(iter(parts)) == "face"
    assert parts["cavity"][0].request.points == POINTS + SPARE and parts["cavity"][0].request.spare == SPARE > 0
    assert parts["cavity"][0].request.dense and not parts["face"][0].request.dense
    assert parts["cavity"][0].budget[1] == pytest.approx(CHORD_MM / 0.24 * parts["face"][0].budget[1])
    vertices = np.concatenate([i.vertex for i in parts["cavity"][1]])
    assert (vertices >= OUTER).mean() > 0.7
    faces = np.concatenate([i.vertex for i in parts["face"][1]])
    assert not np.isin(np.arange(OUTER + 100, len(head().vertices)), faces).any()
