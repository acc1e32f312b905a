"""Where a further servo helps most, on a skin whose points and shapes are made here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.robot import suggest_servos as module
from controller.robot.anchors import falloff
from controller.robot.suggest_servos import REACH_MM, described, suggest_servos
from surface.head.model.parameters import SHAPES

REST = np.array([[x, y, 0.0] for x in range(-40, 41, 8) for y in range(-40, 41, 8)], float)
JAW, BROW = SHAPES.index("jawOpen"), SHAPES.index("browDownLeft")


def solver_of(*left: np.ndarray) -> Any:
    """A solver whose servos leave these displacements (m, 3) of a face each."""
    moves = np.zeros((len(REST), 3, len(SHAPES), 4))
    moves[REST[:, 1] < 0, 1, JAW] = -1.0
    moves[REST[:, 1] >= 0, 1, BROW] = -1.0
    skin = SimpleNamespace(rest=REST, jaw=np.zeros(len(REST)), moves=moves, part="face")
    return SimpleNamespace(skin=skin, shape_values=lambda face: int(face[0]), residual=lambda number: left[number])


def faces(count: int) -> dict[str, Any]:
    return {f"face {k}": np.array([float(k)]) for k in range(count)}


def pulled(at: int, direction: Any) -> np.ndarray:
    """What one servo does that pulls point ``at`` along a direction (3,) mm."""
    share = falloff(solver_of().skin, REST[at], 0.0, REACH_MM)
    return np.asarray(share[:, None] * np.asarray(direction, float))


LOW, HIGH = (int(np.flatnonzero((REST[:, :2] == at).all(axis=1))[0]) for at in ([-24, -24], [24, 24]))


def test_the_servo_that_is_missing_is_found_with_its_place_direction_and_pull() -> None:
    left = [pulled(LOW, [0.0, 1.2, 1.6]), pulled(LOW, [0.0, -3.0, -4.0]), 0 * REST]
    (found,) = suggest_servos(solver_of(*left), faces(3), P, 1)
    np.testing.assert_allclose(found.point, REST[LOW])
    np.testing.assert_allclose(np.abs(found.direction), [0.0, 0.6, 0.8], atol=1e-9)
    assert (found.direction * [0.0, -0.6, -0.8]).sum() == pytest.approx(1.0)  # the way that most of it goes
    assert found.pull_mm == pytest.approx(5.0) and found.region == P.regions[P.index("jawOpen")]
    assert found.after_mm == pytest.approx(0.0, abs=1e-9) == found.skin_after_mm
    share = falloff(solver_of().skin, REST[LOW], 0.0, REACH_MM)
    size = np.array([2.0, 5.0, 0.0])[:, None] * share
    assert found.skin_before_mm == pytest.approx(np.sqrt((size**2).mean()))
    assert found.before_mm == pytest.approx(np.sqrt((size[:, share > 0] ** 2).mean())) and found.before_mm < 5.0


def test_each_further_one_is_beside_those_before_it_and_the_best_comes_first() -> None:
    left = pulled(LOW, [0.0, 2.0, 0.0]) + pulled(HIGH, [0.0, 0.0, 5.0])
    every = list(suggest_servos(solver_of(left), faces(1), P, 5))
    assert len(every) == 2  # what would hardly help is none
    np.testing.assert_allclose([each.point for each in every], REST[[HIGH, LOW]])
    assert [each.region for each in every] == [P.regions[P.index(n)] for n in ("browDownLeft", "jawOpen")]
    assert every[0].skin_after_mm == every[1].skin_before_mm > every[1].skin_after_mm


@pytest.mark.parametrize(("by", "helps"), [(0.9, False), (1.1, True)])
def test_a_servo_that_hardly_helps_is_none(by: float, helps: bool) -> None:
    unit = _gain(1.0)
    left = pulled(LOW, [0.0, by * 0.05 / unit, 0.0])
    assert bool(list(suggest_servos(solver_of(left), faces(1), P, 1))) == helps


def _gain(pull: float) -> float:
    """By how much the skin within its reach comes closer for a pull of 1 mm."""
    (found,) = suggest_servos(solver_of(pulled(LOW, [0.0, pull, 0.0])), faces(1), P, 1)
    return found.before_mm - found.after_mm


def test_a_suggestion_is_one_line_with_the_keys_of_an_anchor() -> None:
    point, direction = np.array([1.26, -2.0, 3.04]), np.array([0.0, 0.604, 0.797])
    said = described(module.Suggestion(point, direction, 4.56, "jaw", 2.34, 0.56, 1.234, 0.5))
    assert "in the region jaw, at point = [1.3, -2.0, 3.0], direction = [0.0, 0.6, 0.8], up to 4.6 mm" in said
    assert "there 2.3 mm left would become 0.6, of the whole skin 1.23 -> 0.50 mm (rms)" in said


@pytest.mark.parametrize("way_mm", [(0.3, 0.1, 0.0), (-0.3, -0.1, 0.0), (0.0, 40.0, -9.0)])
def test_a_servo_pulls_where_the_face_wants_to_go_however_short_the_way(way_mm: tuple[float, float, float]) -> None:
    way = np.array(way_mm)
    _, direction = module._best(np.array([[0.1], [1.0]]), way[None, None])
    assert direction == pytest.approx(way / np.linalg.norm(way))
