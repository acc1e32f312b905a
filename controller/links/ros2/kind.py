"""Defines the link kind ``ros2``: a ROS 2 node that reaches other nodes through a Zenoh router (rmw_zenoh)."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from controller.links.kind import LinkKind
from drivers.base.options import option

DISTRIBUTIONS = ("humble", "iron", "jazzy", "kilted")
"""Distributions of ROS 2 whose message types rosbags has."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_NAMESPACE = re.compile(r"/(?:[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*)?")
_ENDPOINT = re.compile(r"[a-z]+/\S+:\d+")
_DOMAIN_VARIABLE = "ROS_DOMAIN_ID"


@dataclass(frozen=True, kw_only=True)
class Ros2Settings:
    """Options of the link in a stage file."""

    connect: str = option("Zenoh's endpoint of the router that the ROS nodes use.", "tcp/127.0.0.1:7447")
    node: str = option("Name of the node.", "omote", longest=64)
    namespace: str = option("Namespace of the node's topics, such as /maple.", "/")
    domain: int | None = option(
        f"ROS domain. Default: the environment variable {_DOMAIN_VARIABLE}, else 0.", at_least=0, at_most=232
    )
    distribution: str = option("ROS distribution whose message types are used.", "jazzy", choices=DISTRIBUTIONS)
    rate_hz: float = option("How often the face is published.", 30.0, at_least=1.0, at_most=100.0)
    layer: str = option("The layer that received values are written to.", "capture")
    frames: bool = option("Publish the frames of head and eyes on /tf; false if robot_state_publisher does.", True)
    config: str | None = option("A file of Zenoh's own settings (JSON5), for example with certificates.")

    def check(self) -> None:
        """Raises ValueError: the node's name, namespace, endpoint or domain is not valid."""
        if not _NAME.fullmatch(self.node):
            raise ValueError(f"node: {self.node!r} is not a valid ROS name; use letters, digits and _")
        if not _NAMESPACE.fullmatch(self.namespace):
            raise ValueError(f'namespace: {self.namespace!r} is not valid in ROS; write it as "/maple"')
        if not _ENDPOINT.fullmatch(self.connect):
            raise ValueError(f'connect: {self.connect!r} is not an endpoint; write it as "tcp/127.0.0.1:7447"')
        _ = self.domain_id

    @property
    def domain_id(self) -> int:
        """The ROS domain. Raises ValueError: the environment variable holds no valid domain."""
        if self.domain is not None:
            return self.domain
        text = os.environ.get(_DOMAIN_VARIABLE, "").strip() or "0"
        if not text.isascii() or not text.isdigit() or int(text) > 232:
            raise ValueError(f"{_DOMAIN_VARIABLE}={text!r} is not a domain; it must be a whole number from 0 to 232")
        return int(text)

    @property
    def address(self) -> str:
        """Endpoint of the router."""
        return self.connect


LINK = LinkKind(
    api=1,
    kind="ros2",
    title="A node of ROS 2",
    settings=Ros2Settings,
    open="controller.links.ros2.link:open_ros2",
    install="omote[ros2]",
)
