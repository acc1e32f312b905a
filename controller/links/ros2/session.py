"""Provides a ROS 2 node on its own Zenoh session: publishers and subscriptions that appear in the ROS graph."""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.base.errors import OMOTE_ERRORS, LinkError
from controller.formats.frame import Refusals
from controller.links.ros2.definitions import MessageTypes, message_types
from controller.links.ros2.kind import Ros2Settings
from controller.links.ros2.wire import PUBLISHER, SUBSCRIPTION, GraphNode, Topic, attachment
from surface.base.extras import importing

if TYPE_CHECKING:
    import zenoh  # optional: the extra ros2

log = logging.getLogger(__name__)

CONNECT_MS = 10_000
"""How long to wait for the router at the start."""
MAX_MESSAGE_BYTES = 262_144
"""Longer messages are refused."""
_HINT = "start the router of ROS: ros2 run rmw_zenoh_cpp rmw_zenohd, or correct connect"


class RosPublisher:
    """Publishes messages of one topic. sent : number of messages published."""

    def __init__(self, session: zenoh.Session, types: MessageTypes, topic: Topic, domain: int) -> None:
        self._types, self._topic, self._gid, self.sent = types, topic, os.urandom(16), 0
        self.declared = session.declare_publisher(topic.key(domain))

    def publish(self, **fields: Any) -> None:
        """Publish a message with these fields."""
        message = self._types.make(self._topic.message_type, **fields)
        self.sent += 1
        data = self._types.encode(message, self._topic.message_type)
        self.declared.put(data, attachment=attachment(self.sent, time.time_ns(), self._gid))


class RosNode:
    """A node of the ROS graph.

    beside : the stage file, to whose folder a settings file is relative; None for the current folder.

    Attributes
    ----------
    refused : number of messages that were refused, by reason.

    Raises LinkError: the router cannot be reached, or the settings file cannot be read. MissingPackage: Zenoh or
    rosbags is not installed.
    """

    def __init__(self, settings: Ros2Settings, beside: Path | None) -> None:
        self.types, self.refused = message_types(settings.distribution), Refusals()
        self._closers, self._domain, self._namespace = ExitStack(), settings.domain_id, settings.namespace
        self._session = _open_session(settings, beside)
        self._closers.callback(self._session.close)
        self._graph = GraphNode(self._domain, str(self._session.zid()), settings.namespace, settings.node)
        self._endpoint_count = 0
        self._declare_token(self._graph.token())

    @property
    def connected(self) -> bool:
        """Whether the session is connected to a router now."""
        return bool(list(self._session.info.routers_zid()))

    def name(self, topic: str) -> str:
        """Return the absolute name of a topic of this node; a name that begins with ``/`` is absolute already."""
        return topic if topic.startswith("/") else f"{self._namespace.rstrip('/')}/{topic}"

    def publisher(self, topic: str, message_type: str) -> RosPublisher:
        """Announce and return a publisher of messages of a type on a topic."""
        declared = self.types.topic(self.name(topic), message_type)
        publisher = RosPublisher(self._session, self.types, declared, self._domain)
        self._closers.callback(publisher.declared.undeclare)
        self._announce(PUBLISHER, declared)
        return publisher

    def subscribe(self, topic: str, message_type: str, take: Callable[[Any], object]) -> None:
        """Call ``take`` with each message of a type on a topic, in a thread of Zenoh.

        A message for which it raises is counted in ``refused``.
        """
        declared = self.types.topic(self.name(topic), message_type)

        def receive(sample: zenoh.Sample) -> None:
            try:
                data = sample.payload.to_bytes()
                if len(data) > MAX_MESSAGE_BYTES:
                    raise LinkError("message too long")
                take(self.types.decode(data, message_type))
            except OMOTE_ERRORS as error:
                self.refused.add(f"{topic}: {error}")
            except Exception as error:  # noqa: BLE001  damaged bytes make rosbags raise anything
                log.debug("ros2 %s: %s: %s", topic, type(error).__name__, error)
                self.refused.add(f"{topic}: damaged")

        subscriber = self._session.declare_subscriber(declared.key(self._domain, any_hash=True), receive)
        self._closers.callback(subscriber.undeclare)
        self._announce(SUBSCRIPTION, declared)

    def close(self) -> None:
        """Leave the graph."""
        self._closers.close()

    def _announce(self, endpoint_kind: str, topic: Topic) -> None:
        self._endpoint_count += 1
        self._declare_token(self._graph.endpoint_token(self._endpoint_count, endpoint_kind, topic))

    def _declare_token(self, key: str) -> None:
        self._closers.callback(self._session.liveliness().declare_token(key).undeclare)


def _open_session(settings: Ros2Settings, beside: Path | None) -> zenoh.Session:
    with importing("a link to ROS 2", "zenoh"):
        import zenoh  # optional: the extra ros2
    zenoh.init_log_from_env_or("error")
    config = zenoh.Config() if settings.config is None else _read_config(settings.config, beside)
    entries: dict[str, object] = {
        "mode": "client", "connect/endpoints": [settings.connect], "connect/timeout_ms": CONNECT_MS,
        "scouting/multicast/enabled": False, "timestamping/enabled": False,
    }  # fmt: skip
    for key, value in entries.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        why = str(error).partition(" at ")[0]
        raise LinkError(f"ros2 {settings.connect}: {why}", hint=_HINT) from error


def _read_config(name: str, beside: Path | None) -> zenoh.Config:
    """Read Zenoh's own settings from a file, relative to the folder of the stage file. Raises LinkError."""
    import zenoh  # optional: the extra ros2

    path = (beside.parent if beside is not None else Path()) / name
    if not os.access(path, os.R_OK) or not path.is_file():
        raise LinkError(f"ros2 config: {path} cannot be read as a file", hint=f"look at: ls -l {path}")
    try:
        return zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        why = str(error).rpartition(" at /")[0] or str(error)  # cut off the place in Zenoh's own source
        raise LinkError(f"ros2 config {path}: {why.strip()}", hint="correct it, or leave config out") from error
