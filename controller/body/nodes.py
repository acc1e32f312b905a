"""Connects the bodies of a process with the other processes of their stage."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from controller.body.body import Body
from controller.stage.stage import Stage

if TYPE_CHECKING:
    from controller.fleet.node import Node  # optional: most stages need no network


def open_node(stage: Stage, bodies: Sequence[Body]) -> Node | None:
    """Connect the heads of this process to the stage's other processes; return None if the stage has no ``[zenoh]``.

    Raises LinkError: an endpoint or a file cannot be used. MissingPackage: Zenoh is not installed.
    """
    settings = stage.settings.zenoh
    if settings is None:
        return None
    from controller.fleet.node import Node  # optional: most stages need no network

    heads = {head_key(body.state.name or stage.settings.name): body for body in bodies}
    states = {name: body.state for name, body in heads.items()}
    clock = bodies[0].clock
    node = Node(settings, stage.parameters, states, stage.path, clock.hurry, clock.align, lambda: clock.deadline_ns)
    for name, body in heads.items():
        body.relay, body.rests = partial(node.relay, name), partial(node.rests, name)
    return node


def head_key(name: str) -> str:
    """Convert a name to a part of a Zenoh key: letters, digits, ``_`` and ``-``."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-_") or "head"
