"""controller.links.ros2.publishing: what is published of a face, its servos and links, and how often."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="pip install 'omote[ros2]'")

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.ros2 import publishing as module
from controller.links.ros2.definitions import UNITS, message_types
from controller.links.ros2.faces import HeadJoints
from controller.links.ros2.publishing import Publishing
from surface.head import save_data
from tests.surface.small_head import small_head

TIME_NS = 12 * 10**9 + 345


class Topic:
    """Keeps messages; each must fit its type on the wire."""

    def __init__(self, kind: str) -> None:
        self.kind, self.sent, self.messages = kind, 0, list[Any]()

    def publish(self, **fields: Any) -> None:
        """Keep a message as it arrives."""
        types = message_types("jazzy")
        self.sent += 1
        data = types.encode(types.make(self.kind, **fields), self.kind)
        self.messages.append(types.decode(data, self.kind))


class Node:
    """A node whose publishers keep what is published."""

    def __init__(self) -> None:
        self.types, self.topics = message_types("jazzy"), dict[str, Topic]()

    def name(self, topic: str) -> str:
        """An absolute name."""
        return f"/maple/{topic}"

    def publisher(self, topic: str, kind: str) -> Topic:
        """Declare a publisher."""
        self.topics[topic] = Topic(kind)
        return self.topics[topic]


class Rig:
    """A face that is published, turn by turn."""

    def __init__(self, joints: HeadJoints | None, *, frames: bool = True) -> None:
        self.node, self.state = Node(), CommandState(P)
        self.publishing = Publishing(self.node, self.state, joints, 10.0, "maple/", frames=frames)  # type: ignore[arg-type]

    def show(self, **values: float) -> np.ndarray:
        """Show a face for long enough that it is reached."""
        self.state.set_parameters([P.index(name) for name in values], list(values.values()), 1)
        out = P.neutral()
        for tick in range(1, 400):
            self.state.tick(10_000_000 * tick, 0.01, out)
        return out

    def last(self, topic: str) -> Any:
        """The newest message of a topic."""
        return self.node.topics[topic].messages[-1]


@pytest.fixture(scope="module")
def joints(tmp_path_factory: pytest.TempPathFactory) -> HeadJoints:
    folder: Path = tmp_path_factory.mktemp("head")
    save_data(folder, small_head())
    return HeadJoints(P, folder)


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(module.time, "time_ns", lambda: TIME_NS)
    yield


def test_topics_are_those_of_what_is_known(joints: HeadJoints) -> None:
    plain = {"parameters", "action_units", "expression", "/diagnostics"}
    assert Rig(None).node.topics.keys() == plain
    assert Rig(joints, frames=False).node.topics.keys() == plain | {"joint_states"}
    assert Rig(joints).node.topics.keys() == plain | {"joint_states", "/tf"}


def test_a_face_is_published_in_all_its_forms(joints: HeadJoints) -> None:
    rig = Rig(joints)
    shown = rig.show(jawOpen=0.5, headYaw=0.5, mouthSmileLeft=0.8, mouthSmileRight=0.8, cheekSquintLeft=0.6,
                     cheekSquintRight=0.6)  # fmt: skip
    rig.publishing._publish_all(100.0)
    parameters = rig.last("parameters")
    np.testing.assert_array_equal(parameters.data, shown)
    (dimension,) = parameters.layout.dim
    assert (dimension.label, dimension.size, dimension.stride) == ("parameters", len(P), len(P))
    units = rig.last("action_units")
    assert units.intensity.shape == (UNITS,) and units.intensity[26] > 0.3 and (units.confidence == 1.0).all()
    expression = rig.last("expression")
    assert expression.expression == "happy" and 0.0 < expression.confidence <= 1.0
    assert expression.valence > 0.2
    states = rig.last("joint_states")
    assert states.name == [f"maple/{name}" for name in joints.names] and len(states.velocity) == 0
    np.testing.assert_array_equal(states.position, joints.angles(shown))
    for topic in ("action_units", "expression", "joint_states"):
        header = rig.last(topic).header
        assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (12, 345, "maple/base_link")


def test_frames_hang_from_each_other_under_the_prefix(joints: HeadJoints) -> None:
    rig = Rig(joints)
    shown = rig.show(headYaw=0.5, leftEyePitch=-0.5)
    rig.publishing._publish_all(100.0)
    for found, wanted in zip(rig.last("/tf").transforms, joints.frames(shown), strict=True):
        assert found.header.frame_id == f"maple/{wanted.parent}" and found.child_frame_id == f"maple/{wanted.name}"
        assert found.header.stamp.sec == 12
        at, turn = found.transform.translation, found.transform.rotation
        np.testing.assert_allclose([at.x, at.y, at.z], wanted.position_m)
        np.testing.assert_allclose([turn.x, turn.y, turn.z, turn.w], wanted.rotation)


def test_a_message_keeps_its_values_while_the_face_goes_on() -> None:
    rig = Rig(None)
    kept = list[np.ndarray]()
    rig.node.topics["parameters"].publish = lambda layout, data: kept.append(data)  # type: ignore[method-assign]
    rig.publishing._publish_all(100.0)
    rig.show(jawOpen=1.0)
    rig.publishing._publish_all(100.1)
    assert kept[0][P.index("jawOpen")] == 0.0 < kept[1][P.index("jawOpen")]


def test_diagnostics_come_once_a_second() -> None:
    rig = Rig(None)
    for now_s in (100.0, 100.1, 100.99, 101.0, 101.5, 102.01):
        rig.publishing._publish_all(now_s)
    assert rig.node.topics["/diagnostics"].sent == 3 and rig.node.topics["parameters"].sent == 6
    assert rig.publishing.sent == 3 + 3 * 6


def level_of(status: Any) -> int:
    """OK 0, WARN 1 or ERROR 2; a byte of ROS, which versions of rosbags give as bytes or as a number."""
    return int.from_bytes(status.level, "little") if isinstance(status.level, bytes) else int(status.level)


def test_diagnostics_say_how_the_face_and_every_servo_and_link_are() -> None:
    rig = Rig(None)
    rig.state.servo_records = lambda: [
        {"name": "jaw", "position_deg": 3.5, "error": "overload", "history": [1, 2]}, {"channel": "lid", "error": ""},
    ]  # fmt: skip
    rig.state.link_records = lambda: [{"port": "/dev/ttyUSB0", "error": "unplugged"}, {"kind": "vmc"}]
    rig.publishing._publish_all(100.0)
    message = rig.last("/diagnostics")
    assert [(each.name.removeprefix("/maple/omote: "), level_of(each), each.message) for each in message.status] == [
        ("face", 0, "OK"), ("servo jaw", 2, "overload"), ("servo lid", 0, "OK"),
        ("link /dev/ttyUSB0", 0, "unplugged"), ("link vmc", 0, "OK"),
    ]  # fmt: skip
    assert all(each.name.startswith("/maple/omote: ") for each in message.status)
    pairs = {pair.key: pair.value for pair in message.status[1].values}
    assert pairs == {"name": "jaw", "position_deg": "3.5", "error": "overload"}  # lists are left out
    rig.state.stop_latch.stop("somebody", 1)
    rig.publishing._publish_all(102.0)
    stopped = rig.last("/diagnostics").status[0]
    assert stopped.message == "stopped by somebody" and level_of(stopped) == 1


def test_it_publishes_until_it_is_stopped() -> None:
    rig = Rig(None)
    rig.publishing.stop()  # also before the start
    rig = Rig(None)
    rig.publishing.start()
    end_s = time.monotonic() + 60.0
    while rig.publishing.sent < 8 and time.monotonic() < end_s:
        time.sleep(0.01)
    rig.publishing.stop()
    sent = rig.publishing.sent
    assert sent >= 8
    time.sleep(0.15)
    assert rig.publishing.sent == sent
