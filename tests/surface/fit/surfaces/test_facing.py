"""Which side of a surface is outside, by what is seen from around, and how much is seen from the front."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from surface.base.arrays import Floats, Ints
from surface.fit.surfaces import facing
from surface.fit.surfaces.facing import seen


def ball(radius: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0), *, open_behind: bool = False):
    """Points and outward triangles of a sphere, or of its front."""
    rng = np.random.default_rng(5)
    points = rng.normal(size=(1500, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    triangles: Ints = hull.simplices.astype(np.int64)
    a, b, c = points[triangles].swapaxes(0, 1)
    inward = (np.cross(b - a, c - a) * a).sum(axis=1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    if open_behind:
        triangles = triangles[points[triangles, 2].mean(axis=1) > 0.2 * radius]
    return points + centre, triangles


def turned_over(piece: tuple[Floats, Ints]) -> tuple[Floats, Ints]:
    return piece[0], piece[1][:, ::-1]


@pytest.mark.parametrize("open_behind", [False, True])
def test_a_head_and_a_mask_show_their_outside(open_behind: bool) -> None:
    piece = ball(80.0, open_behind=open_behind)
    area, inside_out = seen([piece])
    assert not inside_out[0]
    share = 1.0 - 0.2**2 if open_behind else 1.0  # of the disc of its outline
    assert area[0] == pytest.approx(share * np.pi * 80.0**2, rel=0.03)
    area, inside_out = seen([turned_over(piece)])
    assert inside_out[0] and area[0] == pytest.approx(share * np.pi * 80.0**2, rel=0.03)


def test_each_piece_is_judged_by_itself_and_what_covers_another_is_not_seen() -> None:
    front, side = ball(20.0, (0.0, 0.0, 70.0)), turned_over(ball(10.0, (0.0, 40.0, 70.0)))
    area, inside_out = seen([ball(60.0), front, side])
    assert inside_out.tolist() == [False, False, True]
    assert area[1] == pytest.approx(np.pi * 20.0**2, rel=0.05) and area[2] == pytest.approx(np.pi * 10.0**2, rel=0.1)
    assert area[0] == pytest.approx(np.pi * (60.0**2 - 20.0**2 - 10.0**2), rel=0.05)


@pytest.mark.parametrize("over", [False, True])
def test_a_piece_that_is_hidden_is_looked_at_alone(over: bool) -> None:
    inner = turned_over(ball(20.0)) if over else ball(20.0)
    area, inside_out = seen([ball(60.0), inner])
    assert inside_out.tolist() == [False, over] and area[1] == 0.0


def test_pictures_are_taken_from_eight_sides_and_count_by_where_they_look_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """One picture shows only the outside of a piece, another one more of its back: the heavier one decides."""
    views = ((0.0, 0.0), (40.0, 0.0), (-40.0, 0.0), (0.0, 50.0), (0.0, -50.0), (90.0, 0.0), (-90.0, 0.0), (180.0, 0.0))
    turns = [facing.view_rotation(yaw, pitch) for yaw, pitch in views]
    weights = [1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.1]
    pieces, asked = [ball(10.0), ball(10.0, (5.0, 0.0, 0.0))], []
    for k, weight in enumerate(weights):
        for other, outside in ((weight * 0.99, True), (weight * 1.01, False)):

            def counts(_: object, every: Floats, turn: Floats, step: float, k: int = k, other: float = other):
                asked.append((turn, step, len(every)))
                own = np.allclose(turn, turns[k])
                shown = 10.0 * own
                first = np.allclose(turn, turns[0 if k else 1])
                return np.array([shown + 10.0 * other * first, 0.0]), np.array([10.0 * other * first, 0.0])

            monkeypatch.setattr(facing, "_counts", counts)
            _, over = facing.seen(pieces)
            assert over[0] == (not outside), k
    step = 25.0 / 240
    np.testing.assert_allclose([turn for turn, *_ in asked[:8]], turns)
    assert all(given == pytest.approx(step, rel=0.01) and count == 3000 for _, given, count in asked[:8])


def test_the_back_counts_what_runs_the_other_way_round() -> None:
    piece = ball(10.0)
    for turned, share in ((piece, 0.0), (turned_over(piece), 1.0)):
        shown, back = facing._counts([turned], turned[0], facing.view_rotation(30.0, 20.0), 0.1)
        assert shown[0] == pytest.approx(np.pi * 100**2, rel=0.03) and back[0] == share * shown[0]
