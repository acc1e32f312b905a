"""Seams of skin with itself are levelled: the borders meet without a crease, and the skin around stays."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface import DCPSurface
from surface.fit.features import levelled
from surface.fit.features.levelled import CREASE_DEG, crease_deg, level_seam, level_seams
from surface.head.model.data import PartData, Seam
from surface.head.model.file import load_data
from surface.head.model.meshes import make_surface

ACROSS = np.linspace(0.1, 0.9, 9)
BORDERS = (np.column_stack([0.0 * ACROSS, ACROSS]), np.column_stack([0.0 * ACROSS + 1.0, ACROSS]))
SEAM = Seam("tube", "tube", *BORDERS)


def clamped(count: int) -> list[float]:
    return [0.0] * 3 + np.linspace(0, 1, count - 2).tolist() + [1.0] * 3  # cubic


def tube(dent_mm: float) -> PartData:
    """A skin round the y axis, 40 mm from it, whose points beside one border are ``dent_mm`` further out."""
    nu, nv = 26, 10
    round_it, along = (np.array([np.mean(clamped(n)[i + 1 : i + 4]) for i in range(n)]) for n in (nu, nv))
    angle, height = np.meshgrid(2 * np.pi * round_it, 60 * along - 30, indexing="ij")
    reach = np.full((nu, nv), 40.0)
    reach[1, 3:7] += dent_mm
    points = np.stack([reach * np.sin(angle), height, reach * np.cos(angle)], axis=-1)
    s = DCPSurface.from_nurbs(3, 3, clamped(nu), clamped(nv), points)
    like = small_head().parts[0]
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    ku, kv = s.padded
    zero = np.zeros(s.n)
    return replace(
        like, name="tube", points=s.points.copy(), weights=s.weights.copy(), knots_u=ku.copy(), knots_v=kv.copy(),
        degrees=np.stack(s.degrees, axis=1), loops=[square], groups=[], jaw=zero, lids=zero,
    )  # fmt: skip


def test_a_crease_is_levelled_and_skin_a_centimetre_away_stays():
    creased = tube(6.0)
    assert crease_deg(creased, *BORDERS).max() > 40.0
    level = level_seam(creased, SEAM)
    assert crease_deg(level, *BORDERS).max() < CREASE_DEG
    gap = make_surface(level).evaluate(BORDERS[0]) - make_surface(level).evaluate(BORDERS[1])
    assert np.linalg.norm(gap, axis=1).max() < 0.3
    far = np.random.default_rng(4).uniform((0.15, 0.0), (0.85, 1.0), (500, 2))
    moved = make_surface(level).evaluate(far) - make_surface(creased).evaluate(far)
    assert np.linalg.norm(moved, axis=1).max() < 0.1


def test_a_seam_without_a_crease_stays_to_the_bit():
    round_it = tube(0.0)
    assert crease_deg(round_it, *BORDERS).max() < CREASE_DEG
    np.testing.assert_array_equal(level_seam(round_it, SEAM).points, round_it.points)


@pytest.mark.parametrize(("material", "levelled"), [("skin", True), ("gums", False)])
def test_of_a_head_only_skin_is_levelled(material, levelled):
    creased = replace(tube(6.0), material=material)
    head = level_seams(small_head(parts=[creased], seams=[SEAM]))
    assert np.array_equal(head.parts[0].points, creased.points) is not levelled


def test_the_shipped_heads_chest_has_no_crease(root):
    head = load_data(root / "configs" / "heads" / "ict")
    seam = next(s for s in head.seams if s.part_a == s.part_b == "back")
    part = next(p for p in head.parts if p.name == "back")
    assert crease_deg(part, seam.uv_a, seam.uv_b).max() < 12.0  # 60 before its points were moved


def test_places_along_a_seam_are_six_to_a_piece():
    found = levelled._between(np.array([[0.0, 0.0], [6.0, 3.0], [6.0, 9.0]]))
    wanted = [[k, 0.5 * k] for k in range(6)] + [[6.0, 3.0 + k] for k in range(7)]
    np.testing.assert_allclose(found, wanted)


def test_a_seam_lies_as_the_skin_within_15_mm_of_it_does():
    seam = np.array([[0.0, 0.0, 0.0]])
    places = np.array([[14.9, 0.0, 0.0], [0.0, -14.9, 0.0], [15.1, 0.0, 0.0], [1.0, 0.0, 0.0]])
    normals = np.array([[0.0, 0, 2], [0, 2, 0], [9, 0, 0], [0, 0, -9]])
    found = levelled._as_around(seam, places, normals, np.array([True, True, True, False]))
    np.testing.assert_allclose(found, [[0.0, np.sqrt(0.5), np.sqrt(0.5)]])


def test_only_the_skin_from_4_to_11_mm_away_tells_how_a_seam_lies(monkeypatch):
    part, asked = tube(6.0), []
    as_around = levelled._as_around
    monkeypatch.setattr(levelled, "_as_around", lambda *given: asked.append(given) or as_around(*given))
    level_seam(part, SEAM)
    seam, places, normals, ring = asked[0]
    one, two = (make_surface(part).evaluate(levelled._between(uv)) for uv in BORDERS)
    np.testing.assert_allclose(seam, 0.5 * (one + two))
    away = np.linalg.norm(places[:, None] - seam[None, ::4], axis=2).min(axis=1)  # about
    assert 3.9 < away[ring].min() < 4.6 and 10.4 < away[ring].max() <= 11.6
    assert not ring[away < 3.9].any() and not ring[away > 11.6].any()
    assert len(places) == 259 * 259 and (np.einsum("ij,ij->i", normals, places * [1, 0, 1]) > 0).all()
    turned = levelled._placed(replace(part, flip=True), BORDERS[0])[1]
    np.testing.assert_allclose(turned, -levelled._placed(part, BORDERS[0])[1])


@pytest.mark.parametrize(("most", "rounds"), [(5.9, 0), (6.0, 6), (90.0, 6)])
def test_a_crease_of_6_degrees_is_levelled_in_six_rounds_at_most(monkeypatch, most, rounds):
    made = []
    monkeypatch.setattr(levelled, "crease_deg", lambda *_: np.array([0.0, most]))
    monkeypatch.setattr(levelled, "_moves", lambda part, _: made.append(1) or np.ones_like(part.points))
    part = tube(0.0)
    np.testing.assert_allclose(level_seam(part, SEAM).points, part.points + rounds)
    assert len(made) == rounds
