"""surface.head.posing.crowd: each head of a crowd is as one head alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.head import Head
from surface.head.model.data import Neck
from surface.head.posing.crowd import Crowd

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def alone() -> Head:
    return Head.load(ROOT / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def crowd() -> Crowd:
    return Crowd(Head.load(ROOT / "configs" / "heads" / "ict"), 3)


def draw(seed: int, count: int, heads: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.5, 1.0, (heads, count)) * (rng.random((heads, count)) < 0.4)


def check(crowd: Crowd, alone: Head) -> None:
    for k in range(len(crowd)):
        alone.pose(crowd.values[k])
        for own, part in zip(crowd.parts, alone.parts, strict=True):
            np.testing.assert_allclose(own.vertices[k], part.vertices, atol=2e-4, err_msg=part.name)
            assert np.mean(np.sum(own.normals[k] * part.normals, axis=1)) > 1.0 - 1e-5, part.name


@pytest.mark.slow
def test_each_head_is_as_one_alone(crowd: Crowd, alone: Head) -> None:
    count = len(alone.parameters)
    for seed in range(2):
        assert crowd.pose(draw(seed, count)) == [0, 1, 2]
        check(crowd, alone)
    still = np.zeros((3, count))  # heads that are not turned are written in another way
    still[1, alone.parameters.index("jawOpen")] = 0.7
    crowd.pose(still)
    check(crowd, alone)


def test_only_heads_that_moved_are_posed(crowd: Crowd, alone: Head) -> None:
    values = draw(3, len(alone.parameters))
    crowd.pose(values)
    before = [part.vertices.copy() for part in crowd.parts]
    values[1, alone.parameters.index("jawOpen")] = 0.9
    assert crowd.pose(values) == [1] and crowd.pose(values) == []
    for own, was in zip(crowd.parts, before, strict=True):
        np.testing.assert_array_equal(own.vertices[[0, 2]], was[[0, 2]])
    check(crowd, alone)


def test_the_one_head_shows_any_of_them_and_is_itself_again(crowd: Crowd, alone: Head) -> None:
    values = draw(4, len(alone.parameters))
    crowd.pose(values)
    for k in (2, 0):
        crowd.show(k)
        for own, part in zip(crowd.parts, crowd.head.parts, strict=True):
            np.testing.assert_array_equal(part.vertices, own.vertices[k])
            assert part.changed == [(0, len(part.vertices))]
    for wanted in (values[1], np.zeros(len(alone.parameters))):
        crowd.head.pose(wanted)
        alone.pose(wanted)
        for shown, part in zip(crowd.head.parts, alone.parts, strict=True):
            np.testing.assert_allclose(shown.vertices, part.vertices, atol=2e-4, err_msg=part.name)
    assert crowd.pose(values) == []  # what the one head did has moved none of them


def test_wrong_values_move_nothing(crowd: Crowd, alone: Head) -> None:
    values = draw(5, len(alone.parameters))
    crowd.pose(values)
    before = [part.vertices.copy() for part in crowd.parts]
    wrong = draw(6, len(alone.parameters))
    wrong[2, alone.parameters.index("jawOpen")] = np.nan
    with pytest.raises(ValueError, match="jawOpen is not a number"):
        crowd.pose(wrong)
    with pytest.raises(ValueError, match="expected"):
        crowd.pose(wrong[:2])
    for own, was in zip(crowd.parts, before, strict=True):
        np.testing.assert_array_equal(own.vertices, was)
    np.testing.assert_array_equal(crowd.values, values)


def test_a_further_head_costs_no_more_than_three_times_its_vertices(crowd: Crowd) -> None:
    arrays = sum(part.vertices[0].nbytes + part.normals[0].nbytes for part in crowd.parts)
    assert crowd.nbytes / len(crowd) <= 3.0 * arrays


def test_no_heads_are_no_crowd(crowd: Crowd) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        Crowd(crowd.head, 0)


def test_the_bytes_of_a_crowd_are_those_of_all_its_arrays(crowd: Crowd) -> None:
    assert len(crowd) == 3
    for part in crowd.parts:
        own = part.vertices.nbytes + part.normals.nbytes
        assert part.vertices.shape == (3, *part.part.vertices.shape) and part.normals.shape == part.vertices.shape
        assert part.nbytes == own + (0 if part.batch is None else part.batch.nbytes)
    assert crowd.nbytes == sum(part.nbytes for part in crowd.parts)
    assert any(part.batch is None for part in crowd.parts) and any(part.batch is not None for part in crowd.parts)
    with pytest.raises(ValueError, match="read-only"):
        crowd.values[0, 0] = 1.0


def test_a_head_that_is_shown_says_how_it_is_turned() -> None:
    crowd = Crowd(Head(small_head()), 2)
    crowd.pose(np.stack([crowd.head.values({}), crowd.head.values({"headYaw": 1.0})]))
    alone = Head(small_head())
    alone.pose(crowd.values[1])
    for k, wanted in ((1, alone.parts[0].turn), (0, np.eye(3)), (1, alone.parts[0].turn)):
        crowd.show(k)
        for part in crowd.head.parts:
            np.testing.assert_allclose(part.turn, wanted, atol=1e-12)


def test_each_head_of_a_crowd_has_its_own_breath_and_pupils() -> None:
    neck = Neck((0.0, 30.0, 0.0), 0.0, 0.0, 15.0)
    crowd, alone = Crowd(Head(small_head(neck=neck)), 3), Head(small_head(neck=neck))
    still, lives = np.zeros((3, len(alone.parameters))), np.array([[0.0, 0.0], [2.0, 0.1], [0.5, -0.1]])
    assert crowd.pose(still, lives) == [1, 2] and crowd.pose(still, lives) == []
    for k, life in enumerate(lives.tolist()):
        alone.live(*life)
        alone.pose(still[0])
        crowd.show(k)
        assert crowd.head.pupil == life[1]
        for own, part in zip(crowd.parts, alone.parts, strict=True):
            np.testing.assert_allclose(own.vertices[k], part.vertices, atol=2e-4)
    assert crowd.pose(still) == [1, 2]  # back at rest
