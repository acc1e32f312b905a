"""A node of zenoh-ros2-sdk in a process of its own: publishes what standard input says, prints what it hears.

Run with the port of a router. A line of input is JSON: ``[topic, type, fields]``.
"""

from __future__ import annotations

import json
import sys
import threading
from typing import Any

import numpy as np
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession
from zenoh_ros2_sdk.utils import get_type_hash

TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
BASE = {"builtin_interfaces/msg/Time": TIME, "std_msgs/msg/Header": HEADER}
ARRAY = {
    "std_msgs/msg/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/msg/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
}
VECTORS = {
    **BASE,
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/msg/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/msg/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    "geometry_msgs/msg/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
}
STATUS = {
    **BASE,
    "diagnostic_msgs/msg/KeyValue": "string key\nstring value\n",
    "diagnostic_msgs/msg/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"
    ),
}
KINDS: dict[str, tuple[str, dict[str, str]]] = {
    "std_msgs/msg/String": ("string data\n", {}),
    "std_msgs/msg/Float64MultiArray": ("std_msgs/MultiArrayLayout layout\nfloat64[] data\n", ARRAY),
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        BASE,
    ),
    "hri_msgs/msg/Expression": (
        "std_msgs/Header header\nstring expression\nfloat32 valence\nfloat32 arousal\nfloat32 confidence\n",
        BASE,
    ),
    "hri_msgs/msg/FacialActionUnits": (
        "std_msgs/Header header\nfloat32[99] intensity\nfloat32[99] confidence\n",
        BASE,
    ),
    "tf2_msgs/msg/TFMessage": ("geometry_msgs/TransformStamped[] transforms\n", VECTORS),
    "diagnostic_msgs/msg/DiagnosticArray": (
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
        STATUS,
    ),
}


def plain(value: Any) -> Any:
    """A message as JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [plain(each) for each in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__ if name[0] != "_"}
    return value


def main() -> None:
    port, lock = int(sys.argv[1]), threading.Lock()
    session = ZenohSession.get_instance("127.0.0.1", port)
    for _, needs in KINDS.values():
        for kind, text in needs.items():
            session.register_message_type(text, kind)

    def say(*found: Any) -> None:
        with lock:
            sys.stdout.write(json.dumps(found) + "\n")
            sys.stdout.flush()

    def options(kind: str) -> dict[str, Any]:
        text, needs = KINDS[kind]
        found = get_type_hash(kind, msg_definition=text, dependencies=needs)
        return {"msg_definition": text, "type_hash": found, "domain_id": 7, "router_port": port}

    say("hashes", {kind: options(kind)["type_hash"] for kind in KINDS})
    publishers: dict[str, ROS2Publisher] = {}
    for line in sys.stdin:
        topic, kind, fields = json.loads(line)
        if fields is None:
            ROS2Subscriber(topic, kind, lambda message, topic=topic: say(topic, plain(message)), **options(kind))
            say("hears", topic)
            continue
        if topic not in publishers:
            publishers[topic] = ROS2Publisher(topic, kind, **options(kind))
        make = session.store.types
        if "header" in make[kind].__dataclass_fields__:
            stamp = make["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
            fields["header"] = make["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        if kind.endswith("MultiArray"):
            fields["layout"] = make["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        arrays = {n: np.array(v, np.float32 if kind.startswith("hri") else np.float64)
                  for n, v in fields.items() if isinstance(v, list) and n != "name"}  # fmt: skip
        publishers[topic].publish(**fields | arrays)


main()
