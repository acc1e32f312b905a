"""Mends: groups for pairs of shapes that do not add up, worth the product of the two."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.head.contact import Feeler
from surface.head.data import Group, HeadData, PartData, Rule
from surface.head.meshes import make_surface
from surface.head.parameters import NAMES, read_pose
from surface.head.rig import SkinRig

Floats = NDArray[np.float64]
TOUCH_MM = 0.15  # sides that are brought together overlap by this


def add_mends(head: HeadData, wanted: list[dict[str, Any]]) -> HeadData:
    """The head with a group and a rule for every wanted pair.

    Parameters
    ----------
    wanted : tables with ``of``, two shapes; ``less``, the share of a shape's displacement that is taken back where
        both are whole; ``close``, the name of a contact whose sides are brought together.
    """
    for table in wanted:
        first, second = table["of"]
        name = f"{first}*{second}"
        parts = [_less(p, name, table.get("less", {})) for p in head.parts]
        head = replace(head, parts=parts, rules=[*head.rules, Rule(name, ({first: 1.0}, {second: 1.0}))])
        if "close" in table:
            head = _closed(head, name, table["close"], (first, second))
    return head


def _less(part: PartData, name: str, shares: dict[str, float]) -> PartData:
    """The part with a group that takes back shares of others."""
    field = np.zeros((len(part.points), 3), np.float32)
    for g in part.groups:
        field[g.ids] -= np.float32(shares.get(g.name, 0.0)) * g.moves
    return _with_group(part, name, field)


def _with_group(part: PartData, name: str, field: NDArray[np.float32]) -> PartData:
    ids = np.flatnonzero(np.abs(field).max(axis=1) > 1e-3).astype(np.int32)
    return replace(part, groups=[*part.groups, Group(name, ids, field[ids])]) if len(ids) else part


def _closed(head: HeadData, name: str, contact: str, pair: tuple[str, ...]) -> HeadData:
    """The head with a group that closes the gap which a pair of whole shapes leaves."""
    touch = next(c for c in head.contacts if c.name == contact)
    part = next(p for p in head.parts if p.name == touch.part)
    points = SkinRig(part, head).apply(read_pose(np.array([float(n in pair) for n in NAMES])))
    feeler = Feeler(touch, part, make_surface(part), head)
    field = feeler.closing(points, TOUCH_MM).astype(np.float32)
    return replace(head, parts=[_with_group(p, name, field) if p is part else p for p in head.parts])
