"""Domains: even-odd loops and checks of their arguments."""

from __future__ import annotations

import numpy as np
import pytest

from surface import Domain, Slit
from tests.surface import shapes


def test_even_odd_with_holes_and_islands() -> None:
    domain = Domain((0, 1, 0, 1), loops=[shapes.circle(0.5, 0.5, 0.4), shapes.circle(0.5, 0.5, 0.2)])
    assert domain.inside([[0.5, 0.8], [0.5, 0.5], [0.05, 0.5], [0.5, 2.0]]).tolist() == [True, False, False, False]
    assert np.isclose(domain.area, np.pi * (0.16 - 0.04), rtol=1e-3)


def test_even_odd_agrees_with_winding_angles() -> None:
    rng = np.random.default_rng(4)
    ring = shapes.circle(0.5, 0.5, 0.3, n=40) + rng.normal(0, 0.02, (40, 2))
    uv = rng.uniform(0, 1, (500, 2))
    angle = np.arctan2(*(ring[None] - uv[:, None]).transpose(2, 0, 1)[::-1])
    turn = np.diff(angle, axis=1, append=angle[:, :1])
    winding = np.round(((turn + np.pi) % (2 * np.pi) - np.pi).sum(axis=1) / (2 * np.pi))
    assert np.array_equal(Domain((0, 1, 0, 1), loops=[ring]).inside(uv), winding % 2 == 1)


def test_slit_end_points_are_not_on_the_open_slit() -> None:
    slit = Slit("v", 0.5, 0.2, 0.4)
    assert slit.holds(np.array([[0.5, 0.2], [0.5, 0.3], [0.5, 0.4], [0.4, 0.3]])).tolist() == [
        False,
        True,
        False,
        False,
    ]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Domain((0, 0, 0, 1)), "rect"),
        (lambda: Domain((0, np.nan, 0, 1)), "rect"),
        (lambda: Domain((0, 1, 0, 1), loops=[[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1]]]), r"loops\[1\]: 2 distinct"),
        (lambda: Domain((0, 1, 0, 1), loops=[[0, 1, 2]]), r"loops\[0\]: shape"),
        (lambda: Domain((0, 1, 0, 1), loops=[[[0, 0], [1, 0], [np.inf, 1]]]), r"loops\[0\]: must be finite"),
        (lambda: Domain((0, 1, 0, 1), marks=[[0.5, np.nan]]), "marks: must be finite"),
        (lambda: Domain((0, 1, 0, 1), marks=[0.1, 0.2, 0.3]), r"marks: shape \(3,\)"),
        (lambda: Domain((0, 1, 0, 1), marks=[[0.1, 0.2, 0.3]]), r"marks: shape \(1, 3\)"),
        (lambda: Domain((0, 1)), r"rect: needs \(u0, u1, v0, v1\)"),
        (lambda: Domain((0, 1, 0, 1), loops=[[[0, 0], [1]]]), r"loops\[0\]\[1\]: shape"),
        (lambda: Domain((0, 1, 0, 1), slits=[("u", 0.5, 0, 1)]), r"slits\[0\]: must be a Slit"),
        (lambda: Slit("u", "x", 0, 1), "Slit"),
        (lambda: Slit("w", 0, 0, 1), "axis"),
        (lambda: Slit("u", 0, 1, 1), "start < end"),
    ],
)
def test_bad_domains_are_named(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


def test_domains_are_shown_and_compared_by_what_was_given() -> None:
    loop = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    domain = Domain((0, 1, 0, 1), [loop])
    assert "segments" not in repr(domain) and "loops" in repr(domain)
    np.testing.assert_array_equal(domain.segments, [[0, 0, 1, 0], [1, 0, 0, 1], [0, 1, 0, 0]])
    assert not domain.segments.flags.writeable and not np.asarray(domain.loops[0]).flags.writeable
    empty = Domain((0, 1, 0, 1))
    assert empty.segments.shape == (0, 4) and np.asarray(empty.marks).shape == (0, 2) and empty.area == 1.0
    assert Domain((2, 5, -1, 1)).area == 6.0


def test_repeated_points_of_a_loop_count_once() -> None:
    twice = [[0, 0], [0, 0], [1, 0], [1, 1], [1, 1], [0, 0]]
    ring = np.asarray(Domain((0, 1, 0, 1), [twice]).loops[0]).tolist()
    assert len(ring) == 3 and sorted(ring) == [[0, 0], [1, 0], [1, 1]]


def test_the_rectangle_holds_its_border() -> None:
    domain = Domain((0, 1, 2, 4))
    ends = [[0, 2], [1, 4], [0, 4], [1, 2], [0.5, 3]]
    assert domain.inside(ends).all()
    for k, step in ((0, -1e-9), (0, 1e-9), (1, -1e-9), (1, 1e-9)):
        place = [0.0 if step < 0 else 1.0, 3.0] if k == 0 else [0.5, 2.0 if step < 0 else 4.0]
        place[k] += step
        assert not domain.inside([place]).any()


def test_the_area_of_loops_within_loops() -> None:
    def square(low: float, high: float) -> list[list[float]]:
        return [[low, low], [high, low], [high, high], [low, high]]

    nested = [square(0.0, 10.0), square(1.0, 9.0), square(2.0, 8.0), square(3.0, 4.0), square(6.0, 7.0)]
    for order in (nested, nested[::-1]):
        assert Domain((0, 10, 0, 10), order).area == pytest.approx(100 - 64 + 36 - 1 - 1)
    turned = [ring[::-1] for ring in nested]  # whichever way they run
    assert Domain((0, 10, 0, 10), turned).area == pytest.approx(70)


def test_slits_hold_what_lies_between_their_ends_along_either_direction() -> None:
    along_u = Slit("u", 0.5, 0.2, 0.4)
    uv = np.array([[0.3, 0.5], [0.2, 0.5], [0.4, 0.5], [0.5, 0.3], [0.3, 0.50001]])
    assert along_u.holds(uv).tolist() == [True, False, False, False, False]
    assert Slit("v", 0.5, 0.2, 0.4).holds(uv[:, ::-1]).tolist() == [True, False, False, False, False]
    for at in (np.nan, np.inf):
        with pytest.raises(ValueError, match="finite"):
            Slit("u", at, 0.0, 1.0)
