"""surface.view.scene.wrinkles"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ball_head import BallHead

from controller.base.paths import find_config
from surface.head import Head, load_data
from surface.view.scene.wrinkles import MOST, Wrinkles, _deepest, wrinkles_of

FOLDER = find_config("heads", "ict")


@pytest.fixture(scope="module")
def head() -> Head:
    return Head.load(FOLDER)


@pytest.fixture(scope="module")
def wrinkles(head: Head) -> Wrinkles:
    found = wrinkles_of(head)
    assert found is not None
    return found


def depth_mm(wrinkles: Wrinkles, head: Head, given: dict[str, float]) -> np.ndarray:
    """(m,) of the face in a pose, as shaders sum it."""
    wrinkles.show(head.values(given))
    at = wrinkles.at(head.part("face")).astype(float)
    depths: np.ndarray = wrinkles.depths[at[:, [0, 2]].astype(int)] * at[:, [1, 3]] / 255.0
    return depths.sum(axis=1)


@pytest.mark.parametrize("name", ["browInnerUp", "browDownLeft", "mouthSmileLeft", "noseSneerLeft"])
def test_it_is_as_deep_as_the_pose_sinks_the_skin(head: Head, wrinkles: Wrinkles, name: str) -> None:
    """Checked by posing the head with its wrinkles and without."""
    data = load_data(FOLDER)
    smooth = Head(replace(data, rules=[rule for rule in data.rules if not rule.group.startswith("wrinkle")]))
    for one in (head, smooth):
        one.pose(one.values({}))
    normals = smooth.part("face").normals.astype(float).copy()
    for one in (head, smooth):
        one.pose(one.values({name: 1.0}))
    sunk = ((smooth.part("face").vertices - head.part("face").vertices) * normals).sum(axis=1)
    found = depth_mm(wrinkles, head, {name: 1.0})
    assert sunk.max() > 0.3
    assert found == pytest.approx(np.maximum(sunk, 0.0), abs=0.08)
    if name == "mouthSmileLeft":
        assert sunk.min() < -0.1, "beside it the skin rises, which does not count"
    head.pose(head.values({}))


def test_each_side_has_its_own(head: Head, wrinkles: Wrinkles) -> None:
    x = head.part("face").mesh.vertices[:, 0]
    found = depth_mm(wrinkles, head, {"mouthSmileLeft": 1.0})
    assert x[np.argmax(found)] > 15.0
    assert not found[x < -5.0].any()


def test_nothing_is_deep_at_rest(head: Head, wrinkles: Wrinkles) -> None:
    assert not depth_mm(wrinkles, head, {}).any()
    assert not depth_mm(wrinkles, head, {"jawOpen": 1.0, "eyeLookUpLeft": 1.0, "headYaw": 0.3}).any()


def test_other_parts_and_copies_at_seams(head: Head, wrinkles: Wrinkles) -> None:
    for part in head.parts:
        at = wrinkles.at(part)
        assert at.shape == (len(part.vertices), 4) and at.dtype == np.uint8
        assert at[:, 1::2].any() == (part.name == "face")


def test_a_vertex_knows_the_two_deepest() -> None:
    share = np.array([[0.0, 0.2, 1.0], [0.4, 0.6, 0.2], [0.0, 0.0, 0.0]])
    assert _deepest(share).tolist() == [[2, 255, 1, 51], [1, 153, 0, 102], [0, 0, 1, 0]]
    assert _deepest(share[:, :1]).tolist() == [[0, 0, 0, 0], [0, 102, 0, 0], [0, 0, 0, 0]]


def test_heads_without_wrinkles_have_none() -> None:
    assert wrinkles_of(BallHead()) is None
    data = load_data(FOLDER)
    assert wrinkles_of(Head(replace(data, rules=[]))) is None, "groups that nothing drives"


def test_no_more_than_shaders_have_room_for() -> None:
    data = load_data(FOLDER)
    rule = next(rule for rule in data.rules if rule.group == "wrinkleRoot")
    more = [f"wrinkle{i}" for i in range(MOST)]

    def filled(part):  # type: ignore[no-untyped-def]
        group = next((g for g in part.groups if g.name == "wrinkleRoot"), None)
        return replace(part, groups=[*part.groups, *(replace(group, name=n) for n in more)]) if group else part

    many = replace(
        data, parts=[filled(p) for p in data.parts], rules=[replace(rule, group=n) for n in more] + data.rules
    )
    found = wrinkles_of(Head(many))
    assert found is not None and found.count == MOST
