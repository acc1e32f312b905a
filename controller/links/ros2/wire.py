"""The wire of rmw_zenoh: key expressions of topics, tokens of nodes and endpoints, and what travels with a message.

Source: docs/design.md of ros2/rmw_zenoh (graph cache, publishers, subscriptions, attachments); the forms that its code
gives to tokens and qualities of service were read from a node of zenoh-ros2-sdk 0.1.8, which the tests speak to.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

PUBLISHER, SUBSCRIPTION = "MP", "MS"
NO_HASH = "TypeHashNotSupported"
"""Of distributions before type hashes."""
_ADMIN, _NODE = "@ros2_lv", "NN"
_QUALITY = "::,10:,:,:,,"
"""Reliable, volatile, the last ten: all but the depth as by default."""
_TRAVELS = struct.Struct("<qqB16s")
_GID_BYTES = 16


@dataclass(frozen=True)
class Topic:
    """name : absolute, as ``/omote/parameters``. kind : ``package/msg/Name``. type_hash : RIHS01 or :data:`NO_HASH`."""

    name: str
    kind: str
    type_hash: str

    @property
    def dds_type(self) -> str:
        """The type's name in DDS."""
        package, folder, name = self.kind.split("/")
        return f"{package}::{folder}::dds_::{name}_"

    def key(self, domain: int, *, any_hash: bool = False) -> str:
        """Key expression of its messages; with ``any_hash`` also of those of other distributions."""
        return f"{domain}{self.name}/{self.dds_type}/{'*' if any_hash else self.type_hash}"


@dataclass(frozen=True)
class GraphNode:
    """A node, as the tokens name it. session : Zenoh's id of the session."""

    domain: int
    session: str
    namespace: str
    name: str

    def token(self) -> str:
        """That the node is there."""
        return f"{_ADMIN}/{self.domain}/{self.session}/0/0/{_NODE}/%/{_mangled(self.namespace)}/{self.name}"

    def endpoint(self, number: int, kind: str, topic: Topic) -> str:
        """That it publishes (:data:`PUBLISHER`) or hears (:data:`SUBSCRIPTION`) a topic; ``number`` : above 0."""
        where = f"{_ADMIN}/{self.domain}/{self.session}/0/{number}/{kind}/%/{_mangled(self.namespace)}/{self.name}"
        return f"{where}/{_mangled(topic.name)}/{topic.dds_type}/{topic.type_hash}/{_QUALITY}"


def attachment(sequence: int, time_ns: int, gid: bytes) -> bytes:
    """What travels with a message: its number, when it was published (ns since 1970), and the publisher's id (16)."""
    return _TRAVELS.pack(sequence, time_ns, _GID_BYTES, gid)


def _mangled(name: str) -> str:
    return name.replace("/", "%")
