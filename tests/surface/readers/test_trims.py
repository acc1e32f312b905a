"""Curves in space come back to (u, v), also where a surface closes; holes and seams of trimmed faces."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface import DCPSurface, SurfaceFileError
from surface.readers.common import Location
from surface.readers.trims import invert, polyline
from tests.surface import shapes


@cache
def cylinder() -> DCPSurface:
    """Radius 2, height 3, clamped at its seam at u = 0 and 4."""
    angle = np.arange(9) * np.pi / 4
    far = np.where(np.arange(9) % 2, 2 * 2**0.5, 2.0)
    ring = np.stack([far * np.cos(angle), far * np.sin(angle)], axis=1)
    net = np.stack([np.column_stack([ring, np.full(9, z)]) for z in (0.0, 3.0)], axis=1)
    weights = np.repeat(np.where(np.arange(9) % 2, 0.5**0.5, 1.0)[:, None], 2, axis=1)
    return DCPSurface.from_nurbs(2, 1, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0, 0, 1, 1], net, weights)


def test_points_of_a_sheet_find_their_parameters() -> None:
    surface = shapes.hills(12)
    uv = np.random.default_rng(1).uniform(0, 1, (300, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert np.abs(found - uv).max() < 1e-9
    assert distance.max() < 1e-9


def test_points_near_a_seam_are_found_on_both_sides_of_it() -> None:
    surface = cylinder()
    u = np.concatenate([np.linspace(1e-3, 0.2, 60), np.linspace(3.8, 3.999, 60)])
    uv = np.stack([u, np.linspace(0.1, 0.9, 120)], axis=1)
    found, distance = invert(surface, surface.evaluate(uv))
    assert np.abs(found - uv).max() < 1e-9
    assert distance.max() < 1e-9


def test_chords_of_a_curve_stray_less_than_asked() -> None:
    def point(t: float) -> np.ndarray:
        return np.array([np.cos(t), np.sin(t), t])

    line = polyline(point, 0.0, 6.0, 1e-3)
    assert np.array_equal(line[[0, -1]], [point(0.0), point(6.0)])
    radii = np.linalg.norm((line[1:, :2] + line[:-1, :2]) / 2, axis=1)
    assert 1 - 1e-3 < radii.min() < 1 - 1e-5


def edge(start: float, end: float, at: Any) -> Any:
    """An edge as openNURBS has it: ``at(t)`` gives u and v on the cylinder."""

    def point(t: float) -> Any:
        x, y, z = cylinder().evaluate([at(t)])[0]
        return SimpleNamespace(X=x, Y=y, Z=z)

    return SimpleNamespace(Domain=SimpleNamespace(T0=start, T1=end), PointAt=point)


def face(monkeypatch: pytest.MonkeyPatch, centre: float) -> Any:
    """The cylinder with a round hole in (u, v) about ``centre``."""
    from surface.readers import rhino

    monkeypatch.setattr(rhino, "_nurbs", lambda place, shape: (cylinder(), None))
    low, high = edge(0, 4, lambda t: (t, 0.0)), edge(0, 4, lambda t: (t, 1.0))
    seam = edge(0, 1, lambda t: (0.0, t))
    hole = edge(0, 2 * np.pi, lambda t: ((centre + 0.3 * np.cos(t)) % 4, 0.5 + 0.2 * np.sin(t)))
    outer = [(0, False), (2, False), (1, True), (2, True)]
    loops = [[SimpleNamespace(EdgeIndex=i, IsReversed=back) for i, back in trims] for trims in (outer, [(3, False)])]
    made = [SimpleNamespace(TrimCount=len(trims), Trims=trims) for trims in loops]
    shape = SimpleNamespace(Loops=made, UnderlyingSurface=lambda: None)
    return rhino._face(
        Location(Path("a.3dm"), "object 0, face 0"), SimpleNamespace(Edges=[low, high, seam, hole]), shape
    )


def test_a_hole_in_a_closed_face_is_a_hole(monkeypatch: pytest.MonkeyPatch) -> None:
    _, domain = face(monkeypatch, 1.7)
    assert len(domain.loops) == 2
    assert domain.area == pytest.approx(4 - np.pi * 0.3 * 0.2, rel=1e-3)
    assert domain.inside([[1.7, 0.5], [1.7, 0.8], [3.0, 0.5]]).tolist() == [False, True, True]


def test_a_hole_across_the_seam_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SurfaceFileError, match=r"face 0, loop 1: crosses the seam"):
        face(monkeypatch, 0.0)
