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
