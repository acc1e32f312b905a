"""A node of ROS 2 on a session of Zenoh of its own: publishers and subscriptions that the graph shows."""

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
"""So long the router is waited for at the start."""
LONGEST = 262_144
"""Bytes of a message that are read at most."""
_HINT = "start the router of ROS: ros2 run rmw_zenoh_cpp rmw_zenohd, or correct connect"


class RosPublisher:
    """Publishes messages of one topic. sent : how many."""

    def __init__(self, session: zenoh.Session, types: MessageTypes, topic: Topic, domain: int) -> None:
        self._types, self._topic, self._gid, self.sent = types, topic, os.urandom(16), 0
        self.declared = session.declare_publisher(topic.key(domain))

    def publish(self, **fields: Any) -> None:
        """Publish a message with these fields."""
        message = self._types.make(self._topic.kind, **fields)
        self.sent += 1
        data = self._types.encode(message, self._topic.kind)
        self.declared.put(data, attachment=attachment(self.sent, time.time_ns(), self._gid))


class RosNode:
    """The node.

    refused : messages that were not taken, by reason.

    Raises LinkError: the router is not there, or a file of settings cannot be read. MissingPackage: Zenoh or rosbags is
    not installed.
    """

    def __init__(self, settings: Ros2Settings, beside: Path | None) -> None:
        self.types, self.refused = message_types(settings.distribution), Refusals()
        self._closers, self._domain, self._space = ExitStack(), settings.domain_id, settings.namespace
        self._session = _open(settings, beside)
        self._closers.callback(self._session.close)
        self._graph = GraphNode(self._domain, str(self._session.zid()), settings.namespace, settings.node)
        self._endpoints = 0
        self._token(self._graph.token())

    @property
    def connected(self) -> bool:
        """Whether a router is reached now."""
        return bool(list(self._session.info.routers_zid()))

    def name(self, topic: str) -> str:
        """The absolute name of a topic of this node; one with ``/`` before it is absolute already."""
        return topic if topic.startswith("/") else f"{self._space.rstrip('/')}/{topic}"

    def publisher(self, topic: str, kind: str) -> RosPublisher:
        """What publishes messages of a type on a topic."""
        wanted = self.types.topic(self.name(topic), kind)
        made = RosPublisher(self._session, self.types, wanted, self._domain)
        self._closers.callback(made.declared.undeclare)
        self._announce(PUBLISHER, wanted)
        return made

    def subscribe(self, topic: str, kind: str, take: Callable[[Any], object]) -> None:
        """Call ``take`` in a thread of Zenoh with each message of a type on a topic; what it raises is counted."""
        wanted = self.types.topic(self.name(topic), kind)

        def heard(sample: zenoh.Sample) -> None:
            try:
                data = sample.payload.to_bytes()
                if len(data) > LONGEST:
                    raise LinkError("message too long")
                take(self.types.decode(data, kind))
            except OMOTE_ERRORS as error:
                self.refused.add(f"{topic}: {error}")
            except Exception as error:  # noqa: BLE001  damaged bytes make rosbags raise anything
                log.debug("ros2 %s: %s: %s", topic, type(error).__name__, error)
                self.refused.add(f"{topic}: damaged")

        subscriber = self._session.declare_subscriber(wanted.key(self._domain, any_hash=True), heard)
        self._closers.callback(subscriber.undeclare)
        self._announce(SUBSCRIPTION, wanted)

    def close(self) -> None:
        """Leave the graph."""
        self._closers.close()

    def _announce(self, kind: str, topic: Topic) -> None:
        self._endpoints += 1
        self._token(self._graph.endpoint(self._endpoints, kind, topic))

    def _token(self, key: str) -> None:
        self._closers.callback(self._session.liveliness().declare_token(key).undeclare)


def _open(settings: Ros2Settings, beside: Path | None) -> zenoh.Session:
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
    """Zenoh's own settings from a file, relative to the stage. Raises LinkError."""
    import zenoh  # optional: the extra ros2

    path = (beside.parent if beside is not None else Path()) / name
    if not os.access(path, os.R_OK) or not path.is_file():
        raise LinkError(f"ros2 config: {path} cannot be read as a file", hint=f"look at: ls -l {path}")
    try:
        return zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        why = str(error).rpartition(" at /")[0] or str(error)  # a place in Zenoh's own source comes last
        raise LinkError(f"ros2 config {path}: {why.strip()}", hint="correct it, or leave config out") from error
