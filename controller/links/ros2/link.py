"""Opens a link as a ROS 2 node whose topics set the face, take commands and publish the face."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from controller.base.errors import LinkError
from controller.base.parameters import Flags, Floats, did_you_mean
from controller.layers.commands import CommandSink
from controller.links.kind import LinkContext
from controller.links.line.session import LineSession
from controller.links.net.meter import Meter
from controller.links.ros2.faces import EXPRESSIONS, ActionUnits, HeadJoints, named_values
from controller.links.ros2.kind import Ros2Settings
from controller.links.ros2.publishing import Publishing
from controller.links.ros2.session import RosNode

_MAX_LINE_BYTES = 4096


def open_ros2(settings: Ros2Settings, context: LinkContext) -> Ros2Link:
    """Open the link, which joins the ROS graph.

    Raises LinkError: the router cannot be reached, the layer is unknown, or a file cannot be read. MissingPackage:
    Zenoh or rosbags is not installed.
    """
    layers = context.sink.layer_names()
    if settings.layer not in layers:
        raise LinkError(
            f"ros2: unknown layer {settings.layer!r}{did_you_mean(settings.layer, layers)}",
            hint=f"there are {', '.join(layers)}",
        )
    joints = None if context.head is None else HeadJoints(context.sink.parameters, context.head)
    node = RosNode(settings, context.beside)
    context.closers.callback(node.close)
    link = Ros2Link(settings, context.sink, node, joints)
    context.closers.callback(link.stop)
    link.start()
    return link


class Ros2Link:
    """A node in the ROS graph; its topics are described in docs/ros2.md."""

    def __init__(self, settings: Ros2Settings, sink: CommandSink, node: RosNode, joints: HeadJoints | None) -> None:
        self._settings, self._sink, self._node, self._joints = settings, sink, node, joints
        self._units, self._meter = ActionUnits(sink.parameters), Meter()
        self._lines = LineSession(sink, time.monotonic_ns(), name=f"ros2 {settings.node}")
        prefix = settings.namespace.strip("/") + "/" if settings.namespace != "/" else ""
        self._publishing = Publishing(node, sink, joints, settings.rate_hz, prefix, frames=settings.frames)
        self._prefix = prefix
        self._answers = node.publisher("command/answer", "std_msgs/msg/String")
        node.subscribe("parameters/set", "std_msgs/msg/Float64MultiArray", self._take_parameters)
        node.subscribe("joint_commands", "sensor_msgs/msg/JointState", self._take_joints)
        node.subscribe("action_units/set", "hri_msgs/msg/FacialActionUnits", self._take_units)
        node.subscribe("expression/set", "hri_msgs/msg/Expression", self._take_expression)
        node.subscribe("expression/name", "std_msgs/msg/String", self._take_name)
        node.subscribe("command", "std_msgs/msg/String", self._take_line)

    def start(self) -> None:
        """Start publishing."""
        self._publishing.start()

    def stop(self) -> None:
        """Stop publishing."""
        self._publishing.stop()

    def report(self) -> dict[str, object]:
        """Return counts of messages accepted, refused (by reason) and published, and the state of the connection."""
        connected = self._node.connected
        return {
            "port": self._settings.address,
            "connected": connected,
            "accepted": self._meter.frames,
            "refused": dict(self._node.refused),
            "sent": self._publishing.sent,
            **self._meter.report(time.monotonic()),
            "error": "" if connected else "no router",
        }

    def _take_parameters(self, message: Any) -> None:
        """Show an array of all parameters in their order; a NaN leaves its parameter to the layers below."""
        p, given = self._sink.parameters, np.asarray(message.data, float)
        if len(given) != len(p):
            raise LinkError(f"{len(given)} parameters, not {len(p)}")
        self._show(np.clip(np.nan_to_num(given), p.low, p.high), np.isfinite(given))

    def _take_joints(self, message: Any) -> None:
        names = [name.removeprefix(self._prefix) for name in message.name]
        values, mask, unknown = named_values(self._sink.parameters, self._joints, names, list(message.position))
        for name in unknown:
            self._node.refused.add(f"joint_commands: {name[:40]!r} is neither a joint nor a parameter")
        if mask.any():
            self._show(values, mask)

    def _take_units(self, message: Any) -> None:
        self._show(self._units.face(message.intensity), self._units.moves)

    def _take_expression(self, message: Any) -> None:
        """Show an expression by its name, or, if that is empty, by valence and arousal.

        A confidence above 0 is its strength; without one the strength is 1.
        """
        strength = float(message.confidence)
        strength = min(strength, 1.0) if strength > 0.0 else 1.0
        name = message.expression or f"VA:{float(message.valence):.4f},{float(message.arousal):.4f}"
        self._show_expression(name, strength)

    def _take_name(self, message: Any) -> None:
        self._show_expression(message.data.strip(), 1.0)

    def _take_line(self, message: Any) -> None:
        answer = self._lines.feed(message.data.encode()[:_MAX_LINE_BYTES].rstrip(b"\r\n") + b"\n", time.monotonic_ns())
        self._meter.note(time.monotonic(), None)
        for line in answer.decode("utf-8", "replace").splitlines():
            self._answers.publish(data=line)

    def _show_expression(self, name: str, strength: float) -> None:
        now_ns = time.monotonic_ns()
        self._sink.expression(EXPRESSIONS.get(name.lower(), name), strength, None, now_ns)
        self._meter.note(now_ns * 1e-9, None)

    def _show(self, values: Floats, mask: Flags) -> None:
        now_ns = time.monotonic_ns()
        self._sink.write_layer(self._settings.layer, values, mask, now_ns, now_ns)
        self._meter.note(now_ns * 1e-9, None)
