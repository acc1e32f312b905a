"""Defines the kind of link that is a node of ROS 2."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from controller.links.kind import LinkKind
from drivers.base.options import option

DISTRIBUTIONS = ("humble", "iron", "jazzy", "kilted")
"""Those whose messages rosbags knows; humble has no type hashes."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SPACE = re.compile(r"/(?:[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*)?")
_ENDPOINT = re.compile(r"[a-z]+/\S+:\d+")
_DOMAIN = "ROS_DOMAIN_ID"


@dataclass(frozen=True, kw_only=True)
class Ros2Settings:
    """Its options in a stage."""

    connect: str = option("Zenoh's endpoint of the router that the ROS nodes use.", "tcp/127.0.0.1:7447")
    node: str = option("Name of the node.", "omote", longest=64)
    namespace: str = option("Namespace of its topics, as /maple; none without.", "/")
    domain: int | None = option(f"ROS domain; {_DOMAIN} of the environment without, or 0.", at_least=0, at_most=232)
    distribution: str = option("Distribution of ROS whose messages are spoken.", "jazzy", choices=DISTRIBUTIONS)
    rate_hz: float = option("How often the face is published.", 30.0, at_least=1.0, at_most=100.0)
    layer: str = option("The layer that shows what is taken.", "capture")
    frames: bool = option("Publish the frames of head and eyes on /tf; not where robot_state_publisher does.", True)
    config: str | None = option("A file of Zenoh's own settings (JSON5), with certificates perhaps.")

    def check(self) -> None:
        """Raises ValueError: a name that ROS does not allow, no endpoint, or a domain that is none."""
        if not _NAME.fullmatch(self.node):
            raise ValueError(f"node: {self.node!r} is no name in ROS; letters, digits and _")
        if not _SPACE.fullmatch(self.namespace):
            raise ValueError(f'namespace: {self.namespace!r} is none in ROS; write it as "/maple"')
        if not _ENDPOINT.fullmatch(self.connect):
            raise ValueError(f'connect: {self.connect!r} is no endpoint; write it as "tcp/127.0.0.1:7447"')
        _ = self.domain_id

    @property
    def domain_id(self) -> int:
        """The domain. Raises ValueError: that of the environment is none."""
        if self.domain is not None:
            return self.domain
        text = os.environ.get(_DOMAIN, "").strip() or "0"
        if not text.isascii() or not text.isdigit() or int(text) > 232:
            raise ValueError(f"{_DOMAIN}={text!r} is no domain, 0 to 232")
        return int(text)

    @property
    def address(self) -> str:
        """Where the router is."""
        return self.connect


LINK = LinkKind(
    api=1,
    kind="ros2",
    title="A node of ROS 2",
    settings=Ros2Settings,
    open="controller.links.ros2.link:open_ros2",
    install="omote[ros2]",
)
