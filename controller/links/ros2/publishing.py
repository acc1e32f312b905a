"""Publishes the face at a steady rate, and the state of its servos and links once a second, on ROS topics."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from controller.base.parameters import Floats
from controller.layers.commands import CommandSink
from controller.links.net.steady import SteadyThread
from controller.links.ros2.faces import ActionUnits, HeadJoints, ros_expression
from controller.links.ros2.session import RosNode, RosPublisher
from controller.vocabulary.reading import Readings

_DIAGNOSTICS_PERIOD_S = 1.0
_FRAME_ID = "base_link"
_OK, _WARN, _ERROR = 0, 1, 2


class Publishing:
    """Publishes in its own thread until it is stopped.

    joints : of the head. None: no joints and frames are published. prefix : put before the names of joints and frames,
    such as ``maple/``. frames : whether to publish frames on /tf.
    """

    def __init__(
        self, node: RosNode, sink: CommandSink, joints: HeadJoints | None, rate_hz: float, prefix: str, *, frames: bool
    ) -> None:
        self._node, self._sink, self._joints, self._prefix = node, sink, joints, prefix
        self._units, self._readings = ActionUnits(sink.parameters), Readings(sink.parameters, sink.vocabulary)
        self._make = node.types.make
        message_types = {
            "parameters": "std_msgs/msg/Float64MultiArray", "action_units": "hri_msgs/msg/FacialActionUnits",
            "expression": "hri_msgs/msg/Expression", "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        }  # fmt: skip
        if joints is not None:
            message_types["joint_states"] = "sensor_msgs/msg/JointState"
            message_types |= {"/tf": "tf2_msgs/msg/TFMessage"} if frames else {}
        self._topics: dict[str, RosPublisher] = {name: node.publisher(name, t) for name, t in message_types.items()}
        self._values, self._diagnosed_s = sink.parameters.neutral(), -np.inf
        self._thread = SteadyThread("ros2, out", 1.0 / rate_hz, self._publish_all)

    @property
    def sent(self) -> int:
        """Number of messages published."""
        return sum(topic.sent for topic in self._topics.values())

    def start(self) -> None:
        """Start publishing."""
        self._thread.start()

    def stop(self) -> None:
        """Stop publishing."""
        self._thread.stop()

    def _publish_all(self, now_s: float) -> None:
        self._sink.snapshot(self._values)
        self._publish_face(self._values)
        if now_s - self._diagnosed_s >= _DIAGNOSTICS_PERIOD_S:
            self._diagnosed_s = now_s
            self._publish_diagnostics()

    def _publish_face(self, values: Floats) -> None:
        header = self._header()
        count = len(values)
        label = self._make("std_msgs/msg/MultiArrayDimension", label="parameters", size=count, stride=count)
        layout = self._make("std_msgs/msg/MultiArrayLayout", dim=[label], data_offset=0)
        self._topics["parameters"].publish(layout=layout, data=values.copy())
        units = self._units.read(values).astype(np.float32)
        self._topics["action_units"].publish(header=header, intensity=units, confidence=np.ones_like(units))
        self._topics["expression"].publish(header=header, **self._expression(values))
        if self._joints is not None:
            self._publish_joints(self._joints, header, values)

    def _expression(self, values: Floats) -> dict[str, Any]:
        ((name, level),) = self._readings.read("EMOTION", values)
        mood = dict(self._readings.read("MOOD", values))
        return {
            "expression": ros_expression(name), "confidence": level, "valence": mood["valence"],
            "arousal": mood["arousal"],
        }  # fmt: skip

    def _publish_joints(self, joints: HeadJoints, header: Any, values: Floats) -> None:
        none = np.zeros(0)
        names = [self._prefix + name for name in joints.names]
        self._topics["joint_states"].publish(
            header=header, name=names, position=joints.angles(values), velocity=none, effort=none
        )
        if "/tf" in self._topics:
            frames = [self._transform(frame, header) for frame in joints.frames(values)]
            self._topics["/tf"].publish(transforms=frames)

    def _transform(self, frame: Any, header: Any) -> Any:
        x, y, z = frame.position_m.tolist()
        qx, qy, qz, qw = frame.rotation.tolist()
        transform = self._make(
            "geometry_msgs/msg/Transform",
            translation=self._make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=self._make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )
        parent = self._make("std_msgs/msg/Header", stamp=header.stamp, frame_id=self._prefix + frame.parent)
        message_type = "geometry_msgs/msg/TransformStamped"
        return self._make(message_type, header=parent, child_frame_id=self._prefix + frame.name, transform=transform)

    def _header(self) -> Any:
        seconds, rest = divmod(time.time_ns(), 1_000_000_000)
        stamp = self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=self._prefix + _FRAME_ID)

    def _publish_diagnostics(self) -> None:
        """Publish one status for the face, and one for each servo and link."""
        state, found = self._sink.status(), self._sink.overview()
        stopped = self._sink.stop_latch.stopped
        face = self._status("face", _WARN if stopped else _OK, f"stopped by {stopped.who}" if stopped else "", state)
        servos = [self._status_of("servo", each) for each in found.get("servos", [])]
        links = [self._status_of("link", each) for each in found.get("links", [])]
        self._topics["/diagnostics"].publish(header=self._header(), status=[face, *servos, *links])

    def _status_of(self, device: str, record: Mapping[str, Any]) -> Any:
        """Return the status of a device, "servo" or "link", from its entry in the overview."""
        name = record.get("name") or record.get("channel") or record.get("port") or record.get("kind") or ""
        error = str(record.get("error") or "")
        return self._status(f"{device} {name}", _ERROR if error and device == "servo" else _OK, error, record)

    def _status(self, name: str, level: int, message: str, record: Mapping[str, Any]) -> Any:
        flat = {key: value for key, value in record.items() if isinstance(value, str | int | float | bool)}
        pairs = [self._make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value)) for key, value in flat.items()]
        return self._make(
            "diagnostic_msgs/msg/DiagnosticStatus", level=level, name=f"{self._node.name('omote')}: {name}",
            message=message or "OK", hardware_id="", values=pairs,
        )  # fmt: skip
