"""What the quad tree saves on ten surfaces: the surfaces are what they are called, and the rows are in order."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface.bench import savings as bench
from surface.bench.comparison import compare

SURFACES = {name: surface for name, surface, _ in bench.nine_surfaces()}


def test_there_are_nine_surfaces_of_about_one_size() -> None:
    assert len(SURFACES) == 9
    for name, surface in SURFACES.items():
        uv = np.random.default_rng(0).uniform(size=(50, 2))
        assert np.isfinite(surface.evaluate(uv)).all(), name
        assert 60 < np.ptp(surface.points, axis=0).max() < 160, name


def test_what_is_turned_is_round_and_the_ring_is_closed() -> None:
    uv = np.random.default_rng(1).uniform(size=(60, 2))
    for name in ("ball", "vase"):
        around = np.hypot(*SURFACES[name].evaluate(uv)[:, :2].T)
        again = np.hypot(*SURFACES[name].evaluate(np.column_stack([0 * uv[:, 0] + 0.3, uv[:, 1]]))[:, :2].T)
        assert np.allclose(around, again, atol=1e-9), name
    ball = np.linalg.norm(SURFACES["ball"].evaluate(uv), axis=1)
    assert np.ptp(ball) < 1.5 and ball.max() <= 50
    x, y, z = SURFACES["ring"].evaluate(uv).T
    assert np.allclose(np.hypot(np.hypot(x, y) - 35, z), 15, atol=1.5)
    assert np.allclose(SURFACES["ring"].evaluate(uv), SURFACES["ring"].evaluate(uv + 1), atol=1e-9)


def test_rows_are_sorted_with_the_least_saving_first_by_either_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Any, int]] = []
    by_chord = {"a": 0.5, "b": None, "c": 0.2}

    def compared(surface: str, domain: None, *, level: int, quantile: float | None) -> list[Any]:
        asked.append((quantile, level))
        found = [SimpleNamespace(name="uniform", saving=0.0), SimpleNamespace(name="by control points", saving=0.1)]
        chord = by_chord[surface]
        return found if chord is None else [*found, SimpleNamespace(name="by chord error", saving=chord)]

    monkeypatch.setattr(bench, "compare", compared)
    rows = bench.savings([(name, name, None) for name in "abc"], 3)  # type: ignore[misc]
    assert asked == [(0.99, 3)] * 3 + [(None, 3)] * 3
    assert [row.name for row in rows] == ["b", "c", "a"] * 2
    assert [row.measure for row in rows] == ["deviation of 99 % of the area"] * 3 + ["RMS"] * 3
    assert np.isnan(rows[0].by_chord) and (rows[1].by_chord, rows[1].by_points) == (0.2, 0.1)


def test_a_small_hill_saves_much_at_equal_root_mean_square() -> None:
    uniform, *_, best = compare(SURFACES["one small hill"], level=4, quantile=None)
    assert best.name == "by chord error" and best.deviation <= uniform.deviation and best.saving > 0.5


@pytest.mark.parametrize(("name", "x", "y", "height"), [
    ("hills", np.pi / 16, 0.0, 10.0), ("hills", np.pi / 16, np.pi / 11, -10.0), ("hills", 0.0, 0.3, 0.0),
    ("one small hill", 0.7, 0.3, 20.0), ("one small hill", 0.7, 0.3 + np.sqrt(0.004), 20 / np.e),
    ("one small hill", 0.7 + np.sqrt(0.004), 0.3, 20 / np.e),
    ("saddle", 1.0, 1.0, 15.0), ("saddle", 0.0, 1.0, -15.0), ("saddle", 0.5, 0.9, 0.0),
    ("crease", 0.0, 0.4, 0.0), ("crease", 1.0, 0.6, 0.0), ("crease", 0.0, 0.44, 30 * np.tanh(1.0)),
    ("ripples", 0.2, 0.2, 6.0), ("ripples", 0.2, 0.2 + np.pi / 40, -6 * np.exp(-np.pi / 10)),
    ("ripples", 0.2 + np.pi / 20, 0.2, 6 * np.exp(-np.pi / 5)),
])  # fmt: skip
def test_sheets_are_as_high_as_their_formula(name: str, x: float, y: float, height: float) -> None:
    found = bench.SHEETS[name](np.array([x]), np.array([y]))
    assert found[0] == pytest.approx(height, abs=1e-12)


def test_terrain_is_a_sum_of_fifteen_waves_of_five_lengths_the_longer_the_higher() -> None:
    rng = np.random.default_rng(4)
    x, y = rng.uniform(size=(2, 40))
    wanted = np.zeros(40)
    rng = np.random.default_rng(4)
    for octave in (2.0, 4.0, 8.0, 16.0, 32.0):
        for _ in range(3):
            way, shift, more = rng.uniform(0, 2 * np.pi, 3)
            wanted += 30 / octave**1.3 * np.sin(2 * octave * (np.cos(way) * x + np.sin(way) * y) + shift + more)
    np.testing.assert_allclose(bench.SHEETS["terrain"](x, y), wanted, atol=1e-9)


def test_the_vase_is_thick_with_a_narrow_ring_near_its_top() -> None:
    at = np.array([0.0, np.pi / 14, 0.9, 0.95])
    radius, height = bench._vase(at)
    ring = np.array([0.0, 0.0, 0.15, 0.15 / np.e])
    np.testing.assert_allclose(radius, 0.5 + 0.25 * np.sin(7 * at) + ring, atol=1e-9)
    np.testing.assert_allclose(height, [0.0, 3 * np.pi / 14, 2.7, 2.85])


def test_control_points_of_sheets_stand_over_100_units_at_the_means_of_their_knots() -> None:
    surface = bench._sheet(lambda x, y: 2 * x + 3 * y, 5)
    assert bench._clamped_knots(5).tolist() == [0, 0, 0, 0, 0.5, 1, 1, 1, 1]
    place = np.array([0.0, 1 / 6, 0.5, 5 / 6, 1.0])
    x, y = (a.ravel() for a in np.meshgrid(place, place, indexing="ij"))
    np.testing.assert_allclose(surface.points, np.column_stack([100 * x, 100 * y, 2 * x + 3 * y]), atol=1e-12)
    assert len(SURFACES["hills"].points) == 1600
    assert len(SURFACES["ball"].points) == 9 * 24 and len(SURFACES["ring"].points) == 24 * 12
