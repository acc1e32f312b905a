"""Provides the message types of ROS 2: those that rosbags has, and the two of ROS4HRI that a face needs.

The fields of the two are those of hri_msgs 2.0.0 (ros4hri/hri_msgs, branch humble-devel, BSD licence). The names of its
expressions are in :mod:`controller.links.ros2.faces`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from controller.links.ros2.wire import NO_HASH, Topic
from surface.base.extras import importing

UNITS = 99
"""Length of the arrays of action units, which are indexed by FACS number."""
_HRI_DEFINITIONS = {
    "hri_msgs/msg/Expression": (
        "std_msgs/Header header\nstring expression\nfloat32 valence\nfloat32 arousal\nfloat32 confidence\n"
    ),
    "hri_msgs/msg/FacialActionUnits": (
        f"std_msgs/Header header\nfloat32[{UNITS}] intensity\nfloat32[{UNITS}] confidence\n"
    ),
}


class MessageTypes:
    """The message types of one distribution, with their serialization (CDR).

    Raises MissingPackage: rosbags is not installed.
    """

    def __init__(self, distribution: str) -> None:
        with importing("a link to ROS 2", "rosbags"):
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # optional: the extra ros2
        self._store = get_typestore(Stores[f"ROS2_{distribution.upper()}"])
        for message_type, text in _HRI_DEFINITIONS.items():
            self._store.register(get_types_from_msg(text, message_type))
        self._has_hashes = distribution != "humble"  # type hashes came with iron

    def topic(self, name: str, message_type: str) -> Topic:
        """Return the topic of this absolute name and of a type such as ``std_msgs/msg/String``."""
        return Topic(name, message_type, self._store.hash_rihs01(message_type) if self._has_hashes else NO_HASH)

    def make(self, message_type: str, **fields: Any) -> Any:
        """Return a message of a type with these fields."""
        return self._store.types[message_type](**fields)

    def encode(self, message: Any, message_type: str) -> bytes:
        """Return a message as CDR with its encapsulation header."""
        return bytes(self._store.serialize_cdr(message, message_type))

    def decode(self, data: bytes, message_type: str) -> Any:
        """Return the message in CDR bytes. For damaged bytes rosbags may raise any exception."""
        return self._store.deserialize_cdr(data, message_type)


@cache
def message_types(distribution: str) -> MessageTypes:
    """Return the types of a distribution, which are read only once."""
    return MessageTypes(distribution)
