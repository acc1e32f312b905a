"""controller.links.ros2: a node of zenoh-ros2-sdk, which shares nothing with omote but Zenoh, speaks with it."""

from __future__ import annotations

import json
import math
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[ros2]'")
pytest.importorskip("rosbags", reason="pip install 'omote[ros2]'")

from controller.base.errors import LinkError  # noqa: E402
from controller.base.parameters import PARAMETERS as P  # noqa: E402
from controller.layers.commands import CommandState  # noqa: E402
from controller.links.kind import LinkContext  # noqa: E402
from controller.links.links import open_links, read_link  # noqa: E402
from controller.links.ros2 import session as session_module  # noqa: E402
from controller.links.ros2.definitions import UNITS, message_types  # noqa: E402
from controller.links.ros2.faces import ActionUnits, HeadJoints  # noqa: E402
from controller.links.ros2.wire import attachment  # noqa: E402
from tests.controller.fleet.nodes import free_port, router, until  # noqa: E402

JAW, YAW = P.index("jawOpen"), P.index("headYaw")
WAIT_S = 60.0


class Far:
    """The foreign node. heard : newest message of each topic; first : what it said first."""

    def __init__(self, port: int) -> None:
        command = [sys.executable, str(Path(__file__).with_name("sdk_node.py")), str(port)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.heard: dict[str, Any] = {}
        self._ready: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            topic, message = json.loads(line)
            if topic == "hears":
                self._ready.put(message)
            else:
                self.heard[topic] = message

    def hear(self, topic: str, kind: str) -> None:
        self.say(topic, kind, None)
        assert self._ready.get(timeout=WAIT_S) == topic

    def say(self, topic: str, kind: str, fields: dict[str, Any] | None) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([topic, kind, fields]) + "\n")
        self.process.stdin.flush()

    def say_until(self, topic: str, kind: str, fields: dict[str, Any], condition: Callable[[], object]) -> None:
        """Repeat a message until it shows: the first ones come before Zenoh has joined both ends."""
        end = time.monotonic() + WAIT_S
        while not condition():
            assert time.monotonic() < end, f"{topic} shows nothing"
            self.say(topic, kind, fields)
            time.sleep(0.05)

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


class Near:
    """A face with the link, ticked 100 times a second."""

    def __init__(self, endpoint: str, head: Path | None, **more: Any) -> None:
        self.state, self._closers, self._stopping = CommandState(P), ExitStack(), threading.Event()
        keys = {"kind": "ros2", "connect": endpoint, "domain": 7, "namespace": "/maple", **more}
        try:
            (self.link,) = open_links([read_link(keys)], LinkContext(self.state, self._closers, head=head))
        except BaseException:
            self._closers.close()
            raise
        self.values = P.neutral()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping.wait(0.01):
            self.state.tick(time.monotonic_ns(), 0.01, self.values)

    def close(self) -> None:
        self._stopping.set()
        self._thread.join()
        self._closers.close()


@pytest.fixture(scope="module")
def ends(root: Path) -> Iterator[tuple[Near, Far]]:
    pytest.importorskip("zenoh_ros2_sdk", reason="pip install zenoh-ros2-sdk", exc_type=ImportError)
    with router() as endpoint:
        near, far = Near(endpoint, root / "configs" / "heads" / "ict"), Far(int(endpoint.rpartition(":")[2]))
        try:
            yield near, far
        finally:
            far.close()
            near.close()


PUBLISHED = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "std_msgs/msg/Float64MultiArray": "1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
"""What rosidl computes for these types, as programs that were generated by it and the documents of ROS give it."""


@pytest.mark.parametrize("distribution", ["iron", "jazzy", "kilted"])
def test_hashes_of_types_are_the_published_ones(distribution: str) -> None:
    types = message_types(distribution)
    for kind, found in PUBLISHED.items():
        assert types.topic("/x", kind).type_hash == f"RIHS01_{found}", kind


@pytest.mark.slow
def test_hashes_of_types_are_those_that_the_other_side_computes(ends: tuple[Near, Far]) -> None:
    _, far = ends
    until(lambda: "hashes" in far.heard, WAIT_S)
    types = message_types("jazzy")
    assert far.heard["hashes"] == {kind: types.topic("/x", kind).type_hash for kind in far.heard["hashes"]}


@pytest.mark.slow
def test_the_face_is_published(ends: tuple[Near, Far]) -> None:
    near, far = ends
    near.state.set_parameters([JAW, YAW], [0.5, 0.25], time.monotonic_ns())
    topics = {
        "/maple/parameters": "std_msgs/msg/Float64MultiArray", "/maple/joint_states": "sensor_msgs/msg/JointState",
        "/maple/action_units": "hri_msgs/msg/FacialActionUnits", "/tf": "tf2_msgs/msg/TFMessage",
        "/maple/expression": "hri_msgs/msg/Expression", "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }  # fmt: skip
    for topic, kind in topics.items():
        far.hear(topic, kind)
    until(lambda: far.heard.keys() >= topics.keys() and far.heard["/maple/parameters"]["data"][JAW] > 0.49, WAIT_S)
    until(lambda: far.heard["/maple/joint_states"]["position"][0] > 0.99 * 0.25 * math.radians(60.0), WAIT_S)
    assert far.heard["/maple/parameters"]["data"] == pytest.approx(near.values.tolist(), abs=0.02)
    joints = far.heard["/maple/joint_states"]
    assert joints["name"][:4] == ["maple/headYaw", "maple/headPitch", "maple/headRoll", "maple/jawOpen"]
    assert joints["position"][0] == pytest.approx(0.25 * math.radians(60.0), abs=0.01)
    assert far.heard["/maple/action_units"]["intensity"][26] > 0.2  # jaw drop
    until(lambda: far.heard["/tf"]["transforms"][0]["transform"]["rotation"]["z"] > 0.12, WAIT_S)
    yaw = far.heard["/tf"]["transforms"][0]
    assert (yaw["header"]["frame_id"], yaw["child_frame_id"]) == ("maple/base_link", "maple/headYaw")
    assert yaw["transform"]["rotation"]["z"] == pytest.approx(math.sin(0.125 * math.radians(60.0)), abs=0.01)
    eyes = {t["child_frame_id"]: t["transform"]["translation"] for t in far.heard["/tf"]["transforms"]}
    assert eyes["maple/leftEyeYaw"]["y"] == pytest.approx(-eyes["maple/rightEyeYaw"]["y"], abs=1e-3)
    assert 0.02 < eyes["maple/leftEyeYaw"]["y"] < 0.04 and eyes["maple/leftEyeYaw"]["x"] > 0.05  # left, and in front
    status = far.heard["/diagnostics"]["status"][0]
    assert status["name"] == "/maple/omote: face" and status["message"] == "OK"
    near.state.stop_latch.stop("a test", time.monotonic_ns())
    until(lambda: far.heard["/diagnostics"]["status"][0]["message"] == "stopped by a test", WAIT_S)
    near.state.stop_latch.start()
    near.state.release([JAW, YAW], time.monotonic_ns())


@pytest.mark.slow
def test_what_topics_ask_shows(ends: tuple[Near, Far]) -> None:
    near, far = ends
    near.state.neutral(0.1, time.monotonic_ns())
    until(lambda: abs(near.values[JAW]) < 0.05, WAIT_S)
    given = [math.nan] * len(P)
    given[JAW] = 0.8
    far.say_until("/maple/parameters/set", "std_msgs/msg/Float64MultiArray", {"data": given},
                  lambda: near.values[JAW] > 0.7)  # fmt: skip
    assert near.state.holder(JAW) == "capture" and near.state.holder(P.index("mouthPucker")) != "capture"
    angle = 0.5 * math.radians(60.0)
    joints = {"name": ["maple/headYaw", "jawOpen", "tongueOut", "wheel"], "position": [angle, 0.0, 0.4, 1.0],
              "velocity": [], "effort": []}  # fmt: skip
    tongue = P.index("tongueOut")
    far.say_until("/maple/joint_commands", "sensor_msgs/msg/JointState", joints,
                  lambda: abs(near.values[YAW] - 0.5) < 0.02 and abs(near.values[tongue] - 0.4) < 0.02)  # fmt: skip
    assert any("'wheel' is no joint" in reason for reason in near.link.report()["refused"])
    units = {"intensity": [0.0] * UNITS, "confidence": [1.0] * UNITS}
    units["intensity"][12] = 1.0
    smile = P.index("mouthSmileLeft")
    far.say_until("/maple/action_units/set", "hri_msgs/msg/FacialActionUnits", units, lambda: near.values[smile] > 0.5)
    mood = {"expression": "sad", "valence": 0.0, "arousal": 0.0, "confidence": 0.0}
    far.say_until("/maple/expression/set", "hri_msgs/msg/Expression", mood,
                  lambda: near.state.status()["expression"] == "sadness")  # fmt: skip
    far.say_until("/maple/expression/name", "std_msgs/msg/String", {"data": "surprise"},
                  lambda: near.state.status()["expression"] == "surprise")  # fmt: skip
    mood = {"expression": "", "valence": 0.8, "arousal": 0.4, "confidence": 0.9}
    far.say_until("/maple/expression/set", "hri_msgs/msg/Expression", mood,
                  lambda: str(near.state.status()["expression"]).startswith("VA:0.8"))  # fmt: skip


@pytest.mark.slow
def test_lines_are_answered_and_what_is_wrong_is_counted(ends: tuple[Near, Far]) -> None:
    near, far = ends
    far.hear("/maple/command/answer", "std_msgs/msg/String")
    string, answer = "std_msgs/msg/String", "/maple/command/answer"
    far.say_until("/maple/command", string, {"data": "SET jawOpen 0.3"}, lambda: answer in far.heard)
    assert far.heard[answer]["data"] == "OK SET 1"
    far.say_until("/maple/command", string, {"data": "STOP"}, lambda: near.state.stop_latch.stopped)
    assert near.state.stop_latch.stopped is not None and near.state.stop_latch.stopped.who == "ros2 omote"
    near.state.stop_latch.start()
    far.say_until("/maple/parameters/set", "std_msgs/msg/Float64MultiArray", {"data": [1.0]},
                  lambda: "parameters/set: 1 parameters, not 59" in near.link.report()["refused"])  # fmt: skip
    far.say_until("/maple/expression/name", string, {"data": "nonsense"},
                  lambda: any("nonsense" in reason for reason in near.link.report()["refused"]))  # fmt: skip
    with zenoh.open(_client(near.link.report()["port"])) as rogue:
        key = message_types("jazzy").topic("/maple/command", string).key(7)
        for data in (b"", b"\0\1", bytes(300_000), b"\0\1\0\0\xff\xff\xff\x7fabc"):
            rogue.put(key, data)
        until(lambda: {"command: damaged", "command: message too long"} <= near.link.report()["refused"].keys(), WAIT_S)
    assert near.link.report()["connected"] and near.link.report()["accepted"] > 0


def _client(endpoint: Any) -> Any:
    config = zenoh.Config()
    for key, value in {"mode": "client", "connect/endpoints": [endpoint]}.items():
        config.insert_json5(key, json.dumps(value))
    return config


def graph(endpoint: str) -> set[tuple[str, str]]:
    """Topics and types of the graph of domain 7, by the tokens of publishers and subscriptions."""
    with zenoh.open(_client(endpoint)) as session:
        keys = [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/7/**", timeout=5.0)]
    found = [key.split("/") for key in keys if "/NN/" not in key]
    kinds = ((parts[9].strip("%").replace("%", "/"), *parts[10].split("::")) for parts in found)
    return {(topic, f"{package}/{name.rstrip('_')}") for topic, package, _, _, name in kinds}


def test_the_graph_shows_node_and_topics_until_the_link_is_closed() -> None:
    with router() as endpoint, zenoh.open(_client(endpoint)) as session:
        near = Near(endpoint, None, namespace="/", distribution="humble")

        def tokens() -> list[str]:
            return [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/**", timeout=5.0)]

        until(lambda: len(tokens()) >= 12)
        found = tokens()
        assert sum("/NN/%/%/omote" in key for key in found) == 1
        published = next(key for key in found if "/MP/" in key and "%parameters/" in key)
        assert published.endswith(
            "/%parameters/std_msgs::msg::dds_::Float64MultiArray_/TypeHashNotSupported/::,10:,:,:,,"
        )
        assert not any("joint_states" in key for key in found)  # no head is known
        near.close()
        until(lambda: not tokens())


def test_what_cannot_be_used_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "CONNECT_MS", 200)
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    with pytest.raises(LinkError, match=f"ros2 {nowhere}: Unable to connect") as caught:
        Near(nowhere, None)
    assert "rmw_zenohd" in str(caught.value.hint)
    with pytest.raises(LinkError, match="unknown layer 'captur', did you mean 'capture'"):
        Near(nowhere, None, layer="captur")
    with pytest.raises(LinkError, match=r"none\.json5 cannot be read"):
        Near(nowhere, None, config="none.json5")


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"node": "my node"}, "is no name in ROS"),
        ({"namespace": "maple"}, "is none in ROS"),
        ({"connect": "127.0.0.1"}, "is no endpoint"),
        ({"domain": 500}, "232"),
        ({"distribution": "foxy"}, "jazzy"),
    ],
)
def test_settings_that_ros_does_not_allow_are_refused(keys: dict[str, Any], why: str) -> None:
    with pytest.raises(Exception, match=why):
        read_link({"kind": "ros2", **keys})


def test_the_domain_of_the_environment_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    from controller.links.ros2.kind import Ros2Settings

    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert Ros2Settings().domain_id == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert Ros2Settings().domain_id == 42 and Ros2Settings(domain=3).domain_id == 3
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    with pytest.raises(ValueError, match="ROS_DOMAIN_ID='many' is no domain"):
        Ros2Settings().check()


def test_damaged_intensities_count_as_nothing() -> None:
    units, given = ActionUnits(P), np.full(UNITS, np.nan)
    given[26], given[12] = np.inf, -5.0
    face = units.face(given)
    assert np.isfinite(face).all() and face[JAW] == 0.5 and face[P.index("mouthSmileLeft")] == 0.0
    assert units.read(face)[26] > 0.9


def test_angles_of_joints_are_those_of_full_scale(root: Path) -> None:
    joints = HeadJoints(P, root / "configs" / "heads" / "ict")
    yaw, jaw = joints.names.index("headYaw"), joints.names.index("jawOpen")
    ones = joints.angles(np.ones(len(P)))
    assert np.degrees(ones[yaw]) == pytest.approx(60.0) and 20.0 < np.degrees(ones[jaw]) < 30.0
    assert joints.values(0.3 * ones) == pytest.approx(0.3)
    assert joints.values(9.0 * ones) == pytest.approx(1.0) and joints.values(-9.0 * ones)[jaw] == 0.0


def test_a_key_names_domain_topic_type_and_hash() -> None:
    topic = message_types("jazzy").topic("/maple/command", "std_msgs/msg/String")
    kind = "7/maple/command/std_msgs::msg::dds_::String_/"
    assert topic.key(7) == kind + topic.type_hash and topic.key(7, any_hash=True) == kind + "*"


def test_the_jaw_goes_to_neither_side_where_no_side_is_said() -> None:
    units, given = ActionUnits(P), np.zeros(UNITS)
    given[30] = 1.0
    assert not units.face(given).any()


def test_what_travels_with_a_message_is_read_by_the_other_side() -> None:
    other = pytest.importorskip("zenoh_ros2_sdk.attachment", reason="pip install zenoh-ros2-sdk", exc_type=ImportError)
    gid = bytes(range(16))
    found = other.Attachment.from_bytes(attachment(7, 1_700_000_000_000_000_001, gid))
    assert (found.sequence_id, found.timestamp_ns, found.gid) == (7, 1_700_000_000_000_000_001, gid)


@pytest.mark.parametrize(
    ("text", "why"),
    [("{ mode: ", "expected"), ("{ nonsense: 5 }", "unknown field `nonsense`"), (None, "cannot be read")],
)
def test_a_damaged_file_of_settings_is_named_without_zenohs_own_source(
    tmp_path: Path, text: str | None, why: str
) -> None:
    path = tmp_path / "zenoh.json5"
    path.mkdir() if text is None else path.write_text(text)
    with pytest.raises(LinkError, match=why) as caught:
        Near("tcp/127.0.0.1:1", None, config=str(path))
    assert str(path) in str(caught.value) and ".rs:" not in str(caught.value) and caught.value.hint
