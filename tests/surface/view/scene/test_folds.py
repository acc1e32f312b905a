"""surface.view.scene.folds"""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.paths import find_config
from surface.head import Head
from surface.view.scene.folds import Fold, fold_over
from surface.view.scene.openings import Openings

WIDTH, RISE, PLATFORM = 24.0, 5.0, 4.0


def sheet() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flat skin round a left eye, (m, 3), and its vertices along the upper and the lower rim."""
    x = np.linspace(10.0, 60.0, 101)
    y = np.linspace(20.0, 60.0, 161)
    at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    along = np.linspace(0.0, 1.0, 10)
    bow = RISE * np.sin(np.pi * along)
    rims = [np.column_stack([20.0 + WIDTH * along, 35.0 + side * bow]) for side in (1.0, -1.0)]
    upper, lower = (np.array([np.argmin(((at - p) ** 2).sum(axis=1)) for p in rim]) for rim in rims)
    return np.column_stack([at, np.full(len(at), 95.0)]), upper, lower


def fold(depth: float = 1.0, high: float = PLATFORM, behind: float = 0.0) -> tuple[np.ndarray, Fold | None]:
    vertices, upper, lower = sheet()
    far = vertices[:, 1] > 50.0
    vertices[far, 2] -= behind
    return vertices, fold_over(vertices, upper, lower, np.tile((depth, high), (len(vertices), 1)))


@pytest.mark.parametrize("high", [2.0, 4.0])
def test_the_crease_lies_over_the_rim_by_its_platform(high: float) -> None:
    vertices, found = fold(high=high)
    assert found is not None
    crease = vertices[found.ids[2]]
    assert crease[1] == pytest.approx(35.0 + RISE + high, abs=0.5)
    assert found.platform == pytest.approx(high, abs=0.6)
    column = np.abs(vertices[:, 0] - 32.0) < 0.1
    assert found.at[column, 0] == pytest.approx(vertices[column, 1] - crease[1], abs=0.5)


def test_it_fades_at_both_ends_and_is_deepest_over_the_middle() -> None:
    vertices, found = fold(depth=0.7)
    assert found is not None
    deep = [found.at[np.argmin(np.abs(vertices[:, 0] - x)), 1] for x in (18.0, 24.0, 33.0, 44.0, 52.0)]
    assert deep[0] == deep[4] == 0.0
    assert 0.0 < deep[1] < deep[2] > deep[3] > 0.0
    assert deep[2] == pytest.approx(0.7, abs=1e-6)


def test_skin_far_behind_the_lid_has_none() -> None:
    vertices, found = fold(behind=40.0)
    assert found is not None
    assert found.at[vertices[:, 2] < 90.0, 1].max() == 0.0
    assert found.at[vertices[:, 2] > 90.0, 1].max() == 1.0


def test_there_is_none_without_depth_or_width() -> None:
    assert fold(depth=0.0)[1] is None
    vertices, upper, lower = sheet()
    vertices[:, 0] = 20.0
    assert fold_over(vertices, upper, lower, np.ones((len(vertices), 2))) is None


def test_a_shut_lid_keeps_a_soft_line_and_a_sunk_brow_hides_it() -> None:
    vertices, found = fold()
    assert found is not None
    rest = vertices[found.ids]
    assert found.left(rest) == 1.0
    shut = rest - [[0.0, 2.0 * RISE, 0.0], [0.0, 0.0, 0.0], [0.0, RISE, 0.0]]
    assert 0.3 < found.left(shut) < 0.5
    half = rest - [[0.0, RISE, 0.0], [0.0, 0.0, 0.0], [0.0, 0.5 * RISE, 0.0]]
    assert found.left(shut) < found.left(half) < 1.0
    sunk = rest - [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.6 * PLATFORM, 0.0]]
    assert found.left(sunk) < 0.1


def test_the_shipped_head_has_a_fold_over_each_eye() -> None:
    head = Head.load(find_config("heads", "ict"))
    head.pose(head.values({}))
    openings = Openings(head.parts, contacts=head.contacts)
    face = next(part for part in head.parts if part.name == "face")
    assert openings.folded
    at = openings.fold_at(face)
    x, deep = np.asarray(face.vertices)[:, 0], at[:, 1]
    assert deep[x > 0].max() == pytest.approx(1.0)
    assert deep[x > 0].min() == 0.0
    assert deep[x < 0].min() == pytest.approx(-1.0)
    assert openings.fold_left() == pytest.approx((1.0, 1.0))
    assert set(openings.read_vertices()[face.name]) > {i for f in openings._folds if f is not None for i in f.ids}
    head.pose(head.values({"eyeBlinkLeft": 1.0}))
    left, right = openings.fold_left()
    assert left < 0.6
    assert right > 0.95
    head.pose(head.values({"browDownLeft": 1.0, "browDownRight": 1.0}))
    assert max(openings.fold_left()) < 0.9


def test_skin_that_is_painted_without_has_none() -> None:
    head = Head.load(find_config("heads", "ict"))
    face = next(part for part in head.parts if part.name == "face")
    del face.attributes["fold"]
    openings = Openings(head.parts, contacts=head.contacts)
    assert not openings.folded
    assert openings.fold_left() == (0.0, 0.0)
    assert not openings.fold_at(face).any()
