"""Builds the names and attachments with which rmw_zenoh carries ROS 2 over Zenoh.

They are the key expressions of topics, the liveliness tokens of nodes and endpoints, and the attachment of a message.
Source: docs/design.md of ros2/rmw_zenoh (graph cache, publishers, subscriptions, attachments). The exact text of tokens
and qualities of service was read from a node of zenoh-ros2-sdk 0.1.8, with which the tests communicate.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

PUBLISHER, SUBSCRIPTION = "MP", "MS"
"""Codes of the two kinds of endpoint in a token."""
NO_HASH = "TypeHashNotSupported"
"""Stands for the type hash in distributions that have none."""
_ADMIN_SPACE, _NODE = "@ros2_lv", "NN"
_QUALITY_OF_SERVICE = "::,10:,:,:,,"
"""A history depth of 10; every empty field means the default (reliable, volatile)."""
_ATTACHMENT = struct.Struct("<qqB16s")
_GID_BYTES = 16


@dataclass(frozen=True)
class Topic:
    """A topic.

    name : absolute, such as ``/omote/parameters``. message_type : ``package/msg/Name``.
    type_hash : RIHS01, or :data:`NO_HASH`.
    """

    name: str
    message_type: str
    type_hash: str

    @property
    def dds_type(self) -> str:
        """Name of the message type in DDS."""
        package, folder, name = self.message_type.split("/")
        return f"{package}::{folder}::dds_::{name}_"

    def key(self, domain: int, *, any_hash: bool = False) -> str:
        """Return the key expression of its messages; ``any_hash`` : also match those of other distributions."""
        return f"{domain}{self.name}/{self.dds_type}/{'*' if any_hash else self.type_hash}"


@dataclass(frozen=True)
class GraphNode:
    """A node of the ROS graph. session : Zenoh's id of the session."""

    domain: int
    session: str
    namespace: str
    name: str

    def token(self) -> str:
        """Return the liveliness token that announces the node."""
        return self._token(0, _NODE)

    def endpoint_token(self, number: int, endpoint_kind: str, topic: Topic) -> str:
        """Return the liveliness token that announces an endpoint of the node.

        number : of the endpoint, above 0. endpoint_kind : :data:`PUBLISHER` or :data:`SUBSCRIPTION`.
        """
        node = self._token(number, endpoint_kind)
        return f"{node}/{_mangle(topic.name)}/{topic.dds_type}/{topic.type_hash}/{_QUALITY_OF_SERVICE}"

    def _token(self, number: int, entity_kind: str) -> str:
        """Return the token of an entity of the node, which is node 0 of its session; ``%`` is an empty enclave."""
        node = f"{_mangle(self.namespace)}/{self.name}"
        return f"{_ADMIN_SPACE}/{self.domain}/{self.session}/0/{number}/{entity_kind}/%/{node}"


def attachment(sequence: int, time_ns: int, gid: bytes) -> bytes:
    """Return the attachment of a message.

    sequence : number of the message. time_ns : when it was published (ns since 1970). gid : 16 bytes, the publisher's
    id.
    """
    return _ATTACHMENT.pack(sequence, time_ns, _GID_BYTES, gid)


def _mangle(name: str) -> str:
    return name.replace("/", "%")
