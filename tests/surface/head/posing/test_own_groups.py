"""Control points that parameters of a user's own move: in one head, decimated, in a crowd."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.head import NAMES, Crowd, Head, OwnGroup
from surface.head.posing.decimated_head import DecimatedHead
from surface.head.posing.part import SkinPart

ROOT = Path(__file__).parents[4]
JAW, SMILE = NAMES.index("jawOpen"), NAMES.index("mouthSmileLeft")


@pytest.fixture(scope="module")
def groups() -> list[OwnGroup]:
    part = next(p for p in Head.load(ROOT / "configs" / "heads" / "ict").data.parts if p.name == "face")
    chin = np.argsort(np.linalg.norm(part.points - [0.0, -75.0, 104.0], axis=1))[:20].astype(np.int32)
    cheek = np.argsort(np.linalg.norm(part.points - [45.0, -30.0, 85.0], axis=1))[:20].astype(np.int32)
    by = np.tile([0.0, 0.0, 2.0], (20, 1))
    return [OwnGroup("chin", "face", chin, by), OwnGroup("fold", "face", cheek, -by, ("mouthSmileLeft",))]


@pytest.fixture
def head(groups: list[OwnGroup]) -> Head:
    found = Head.load(ROOT / "configs" / "heads" / "ict")
    found.add_groups(groups)
    return found


def points(head: Head, **given: float) -> np.ndarray:
    head.pose(head.values(given))
    face = head.part("face")
    assert isinstance(face, SkinPart)
    return face.rig.points.copy()


def test_parameters_of_their_own_follow_those_of_the_head(head: Head) -> None:
    assert head.parameters == (*NAMES, "chin", "fold")
    with pytest.raises(ValueError, match="expected"):
        head.pose(np.zeros(len(NAMES)))
    wrong = head.values({})
    wrong[-1] = np.nan
    with pytest.raises(ValueError, match="fold is not a number"):
        head.pose(wrong)


def test_a_group_moves_its_points_by_its_value(head: Head, groups: list[OwnGroup]) -> None:
    rest, half = points(head), points(head, chin=0.5)
    assert half[groups[0].ids] - rest[groups[0].ids] == pytest.approx(0.5 * groups[0].moves, abs=0.02)  # lips meet
    assert (points(head) == rest).all()


def test_a_corrective_moves_them_where_its_parameters_are_up(head: Head, groups: list[OwnGroup]) -> None:
    rest, smile = points(head), points(head, mouthSmileLeft=0.5)
    assert (points(head, fold=1.0) == rest).all()
    moved = points(head, fold=1.0, mouthSmileLeft=0.5)[groups[1].ids] - smile[groups[1].ids]
    assert moved == pytest.approx(0.5 * groups[1].moves, abs=1e-9)


@pytest.mark.slow
def test_a_decimated_head_and_a_crowd_move_alike(head: Head, groups: list[OwnGroup]) -> None:
    decimated = DecimatedHead(head, head.parts, "fast", {})
    one, two = head.values({"chin": 0.7}), head.values({"fold": 1.0, "mouthSmileLeft": 0.6, "jawOpen": 0.2})
    fresh = Head.load(ROOT / "configs" / "heads" / "ict")
    fresh.add_groups(groups)
    crowd = Crowd(fresh, 2)
    crowd.pose(np.stack([one, two]))
    for k, values in enumerate((one, two)):
        head.pose(values)
        decimated.pose(values)
        for own in decimated.parts:
            shown = decimated.vertices[own.first : own.last]
            assert np.abs(shown - own.part.vertices[own.kept]).max() < 1e-3, own.part.name
        for each, part in zip(crowd.parts, head.parts, strict=True):
            assert np.abs(each.vertices[k] - part.vertices).max() < 1e-3, part.name


def test_a_factor_that_is_no_parameter_is_refused(head: Head, groups: list[OwnGroup]) -> None:
    with pytest.raises(ValueError, match="'nose' is no parameter"):
        head.add_groups([OwnGroup("x", "face", groups[0].ids, groups[0].moves, ("nose",))])
    assert head.parameters == (*NAMES, "chin", "fold")
