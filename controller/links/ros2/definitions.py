"""Message types of ROS 2: those of rosbags, and the two of ROS4HRI that a face needs.

Fields of hri_msgs 2.0.0 (ros4hri/hri_msgs, branch humble-devel, BSD licence); its constants are in
:mod:`controller.links.ros2.faces`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from controller.links.ros2.wire import NO_HASH, Topic
from surface.base.extras import importing

UNITS = 99
"""Entries of the arrays of action units, by the numbers of FACS."""
_HRI = {
    "hri_msgs/msg/Expression": (
        "std_msgs/Header header\nstring expression\nfloat32 valence\nfloat32 arousal\nfloat32 confidence\n"
    ),
    "hri_msgs/msg/FacialActionUnits": (
        f"std_msgs/Header header\nfloat32[{UNITS}] intensity\nfloat32[{UNITS}] confidence\n"
    ),
}


class MessageTypes:
    """The types of one distribution, and their form on the wire (CDR).

    Raises MissingPackage: rosbags is not installed.
    """

    def __init__(self, distribution: str) -> None:
        with importing("a link to ROS 2", "rosbags"):
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # optional: the extra ros2
        self._store = get_typestore(Stores[f"ROS2_{distribution.upper()}"])
        for kind, text in _HRI.items():
            self._store.register(get_types_from_msg(text, kind))
        self._hashes = distribution != "humble"

    def topic(self, name: str, kind: str) -> Topic:
        """A topic of a type, ``package/msg/Name``."""
        return Topic(name, kind, self._store.hash_rihs01(kind) if self._hashes else NO_HASH)

    def make(self, kind: str, **fields: Any) -> Any:
        """A message."""
        return self._store.types[kind](**fields)

    def encode(self, message: Any, kind: str) -> bytes:
        """CDR with its encapsulation header."""
        return bytes(self._store.serialize_cdr(message, kind))

    def decode(self, data: bytes, kind: str) -> Any:
        """A message; raises what damaged bytes make rosbags raise."""
        return self._store.deserialize_cdr(data, kind)


@cache
def message_types(distribution: str) -> MessageTypes:
    """The types of a distribution, read once."""
    return MessageTypes(distribution)
