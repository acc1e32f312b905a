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
