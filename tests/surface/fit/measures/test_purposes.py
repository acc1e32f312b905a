"""What a head does otherwise than its mesh on purpose."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from surface.fit.features.rigging import BACK_RULE, DROOP_RULE, LOW_RULE
from surface.fit.measures import dense
from surface.fit.measures.purposes import moved_as_a_whole, without_changes
from surface.fit.points.report import DenseErrors, Spot
from surface.head.model.data import HeadData, Jaw, Neck, Rule
from surface.head.model.parameters import NAMES
from surface.head.posing.rig import jaw_path

JAW = Jaw((0.0, 0.0, 0.0), np.radians(25.0), (0.0, -1.0, 2.0))
SLACK = Rule("jawOpen*jawOpen", ({"jawOpen": 1.45, "mouthClose": -1.45}, {"jawOpen": 1.45}))
PAIR = Rule("mouthLeft*mouthPressLeft", ({"mouthLeft": 1.0}, {"mouthPressLeft": 1.0}))
WRINKLE = Rule("wrinkleForehead", ({"browInnerUp": 1.0},))


def head(*rules: Rule) -> HeadData:
    return HeadData("plain", {}, Neck((0.0, 0.0, 0.0)), np.zeros((2, 3)), 0.0, JAW, [], [], [], rules=list(rules))


def test_correctives_and_the_tongues_rules_are_left_out_and_wrinkles_are_not() -> None:
    bare, changed = without_changes(head(LOW_RULE, WRINKLE, SLACK, PAIR, BACK_RULE, DROOP_RULE))
    assert [r.group for r in bare.rules] == ["wrinkleForehead", "tongueDroop"]
    assert changed == ["jawLeft", "jawRight", "jawOpen", "mouthClose", "mouthRollLower"]


def test_a_corrective_that_another_shape_of_the_pose_takes_back_changes_nothing() -> None:
    assert without_changes(head(SLACK))[1] == ["jawOpen"], "mouthClose is shown over an open jaw"
    assert without_changes(head(PAIR))[1] == []


@pytest.mark.parametrize(("follows", "amount"), [("jaw", 1.0), ("skull", 0.0)])
def test_what_follows_as_a_whole_goes_with_the_jaw_or_stays(follows: str, amount: float) -> None:
    values = lambda pose: np.array([pose.get(n, 0.0) for n in NAMES])  # noqa: E731
    subject: Any = SimpleNamespace(head=SimpleNamespace(data=head(), values=values))
    at = np.array([[0.0, -30.0, 100.0], [5.0, -35.0, 90.0]])
    turn, shift = jaw_path(JAW, amount)
    np.testing.assert_allclose(np.asarray(moved_as_a_whole(subject, follows, at, "jawOpen")), at @ turn.T + shift)
    np.testing.assert_allclose(moved_as_a_whole(subject, follows, at, "neutral"), at)


def test_lines_say_how_far_that_goes() -> None:
    far = Spot(6.7, "jawOpen", "tongue", "tongue", True)
    stiff = Spot(3.1, "mouthPressLeft", "gums_lower", "gums", False)
    lines = DenseErrors({}, None, None, (), (), 0, corrected=("jawOpen",), otherwise=far, stiff=stiff).lines()
    assert "they move a point by 6.70 mm at most: shape jawOpen, tongue (tongue)" in lines
    assert any("follow skull or jaw as a whole" in x and "3.10 mm at most: shape mouthPressLeft" in x for x in lines)
    assert not DenseErrors({}, None, None, (), (), 0, stiff=Spot(0.01, "jawOpen", "g", "g", False)).lines()


def test_the_furthest_place_of_all_shapes_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gums:
        """A part that follows the skull; places are as far as the shape's name says."""

        follows = "skull"

        def furthest_of_mesh(self, before: object, after: object, shape: str, places: object) -> Spot:
            return Spot(float(shape), shape, "gums_upper", "gums", False)

    monkeypatch.setattr(dense, "moved_as_a_whole", lambda *_: np.ones((2, 3)))
    purposes, own = dense._OnPurpose(None, []), np.zeros((2, 3))
    part, mesh = cast(Any, Gums()), cast(Any, SimpleNamespace(vertices=own))
    for shape in ("1.0", "3.0", "2.0"):
        moved = purposes.follow(part, mesh, own, shape, cast(Any, None), cast(Any, None))
        assert (moved == 1.0).all()
    assert purposes.stiff is not None and purposes.stiff.mm == 3.0
    part.follows = "skin"
    assert purposes.follow(part, mesh, own, "9.0", cast(Any, None), cast(Any, None)) is own
    assert purposes.stiff.mm == 3.0
