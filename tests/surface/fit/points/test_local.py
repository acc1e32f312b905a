"""Groups that act only where their shape moves the skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface import DCPSurface
from surface.fit.points.local import MOVED_MM, OFF_MM, STILL_MM, localised
from surface.fit.points.report import Localised
from surface.head import Head
from surface.head.model.data import Contact, Group, HeadData, PartData

N = 20
SHAPE = "browInnerUp"


def sheet_part(groups: list[Group]) -> PartData:
    """A sheet of 200 x 200 mm of 20 x 20 points of degree 3."""
    knots = np.concatenate([[0] * 3, np.linspace(0, 1, N - 2), [1] * 3])
    at = np.convolve(knots, np.ones(3) / 3, "valid")[1:-1]
    x, y = np.meshgrid(200 * at, 200 * at, indexing="ij")
    s = DCPSurface.from_nurbs(3, 3, knots, knots, np.stack([x, y, 0.001 * x * y], axis=-1), np.ones((N, N)))
    zero, square = np.zeros(s.n), np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    ku, kv = s.padded
    return PartData(
        "a", "skin", "skin", s.points.copy(), s.weights.copy(), ku.copy(), kv.copy(), np.stack(s.degrees, axis=1),
        [square], np.zeros((0, 3)), (0, 0.1, 4), groups, jaw=zero, lids=zero,
    )  # fmt: skip


def spread(name: str = SHAPE, floor: float = 0.015, at: float = 50.0) -> Group:
    """A bump of 6 mm at ``at`` in x and 50 in y, which a floor spreads over all points."""
    points = sheet_part([]).points
    height = 6.0 * np.exp(-0.5 * ((points[:, 0] - at) ** 2 + (points[:, 1] - 50.0) ** 2) / 20.0**2) + floor
    return Group(name, np.arange(N * N, dtype=np.int32), np.outer(height, [0.0, 0.0, 1.0]).astype(np.float32))


def head_of(groups: list[Group], contacts: list[Contact] | None = None) -> HeadData:
    return small_head(parts=[sheet_part(groups)], seams=[], contacts=contacts or [], paint=[])


def opening(x: float) -> Contact:
    """Two sides at ``x`` mm of the sheet, at y = 100."""
    u, out = np.meshgrid(np.linspace(-0.04, 0.04, 5) + x / 200.0, np.linspace(0.01, 0.05, 6), indexing="ij")
    places = np.stack([np.stack([u, 0.5 + sign * out], axis=-1) for sign in (1.0, -1.0)])
    return Contact("lips", "a", (), -1, 5.0, 0.5, places)


def moved(data: HeadData, name: str = SHAPE) -> tuple[np.ndarray, np.ndarray]:
    """Vertices at rest, and how far a shape at 1 moves each, by its group alone."""
    head = Head(replace(data, contacts=[]))
    head.pose(head.values({}))
    rest = head.parts[0].vertices.astype(float)
    head.pose(head.values({name: 1.0}))
    return rest, head.parts[0].vertices - rest


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_skin_that_hardly_moves_stays_and_other_skin_moves_as_before(scale: float) -> None:
    """On a head of twice the size everything is twice as far."""
    given = head_of([replace(spread(), moves=np.float32(scale) * spread().moves)])
    made, told = localised(given, scale)
    rest, before = moved(given)
    _, after = moved(made)
    size, off = np.linalg.norm(before, axis=1), np.linalg.norm(after - before, axis=1)
    assert off.max() < OFF_MM * scale and off[size > scale].max() < 3e-3 * scale
    far = np.linalg.norm(rest[:, :2] - 50.0, axis=1) > 110.0
    assert (size[far] < STILL_MM * scale).all() and not after[far].any()
    (group,) = made.parts[0].groups
    assert len(group.ids) < 0.7 * N * N and group.moves.dtype == np.float32 and group.ids.dtype == np.int32
    assert (told.before, told.after, told.shape, told.part, told.whole) == (N * N, len(group.ids), SHAPE, "a", {})
    assert off.max() <= told.off_mm + 5e-3 * scale and told.off_mm < 1.3 * off.max()


def test_what_moves_everywhere_and_groups_of_rules_stay_as_they_are() -> None:
    everywhere, fold = spread(floor=2 * MOVED_MM), spread("fold")
    made, told = localised(head_of([everywhere, fold]), 1.0)
    assert np.array_equal(made.parts[0].groups[0].ids, everywhere.ids)
    np.testing.assert_allclose(made.parts[0].groups[0].moves, everywhere.moves)
    assert made.parts[0].groups[1] is fold and told == Localised(N * N, N * N)  # of shapes, and nothing is off


def test_a_group_that_moves_nothing_visible_is_left_out() -> None:
    assert localised(head_of([replace(spread(), moves=0.001 * spread().moves)]), 1.0)[0].parts[0].groups == []


@pytest.mark.parametrize(("x", "quiet"), [(150.0, True), (70.0, False)])
def test_a_contact_that_hardly_moves_is_left_alone(x: float, quiet: bool) -> None:
    """None of the points that its samples depend on moves, so that nothing of it is computed again."""
    contact = opening(x)
    made, _ = localised(head_of([spread()], [contact]), 1.0)
    surface = Head(made).parts[0].surface
    near = np.flatnonzero(surface.basis_matrix(contact.places.reshape(-1, 2)).max(axis=0).toarray() > 0.01)
    assert (not np.isin(near, made.parts[0].groups[0].ids).any()) is quiet


def test_a_group_that_would_be_off_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.fit.points.local.OFF_MM", 0.001)
    given = spread()
    made, told = localised(head_of([given]), 1.0)
    assert made.parts[0].groups == [given] and told == Localised(N * N, N * N, whole={"a": [SHAPE]})


def test_a_report_tells_it_in_words() -> None:
    assert (
        str(Localised(9, 9))
        == "skin that a shape hardly moves stays: 0 of 9 displacements of control points are left out"
    )
    told = str(Localised(90, 30, 0.123, "jawOpen", "face", {"back": ["cheekPuff", "jawLeft"]}))
    assert "60 of 90 displacements" in told and "by 0.12 mm at most: shape jawOpen (face)" in told
    assert told.endswith("; kept whole: cheekPuff, jawLeft (back)")
