"""Mends: groups for pairs of shapes that do not add up, worth the product of the two."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from surface.base.arrays import Floats32
from surface.head.model.data import Group, HeadData, PartData, Rule


def add_correctives(head: HeadData, wanted: list[dict[str, Any]]) -> HeadData:
    """The head with a group and a rule for every wanted pair.

    Parameters
    ----------
    wanted : tables with ``of``, two shapes; ``less``, the share of a shape's displacement that is taken back where
        both are whole.
    """
    for table in wanted:
        first, second = table["of"]
        name = f"{first}*{second}"
        parts = [_corrective_group(p, name, table.get("less", {})) for p in head.parts]
        head = replace(head, parts=parts, rules=[*head.rules, Rule(name, ({first: 1.0}, {second: 1.0}))])
    return head


def _corrective_group(part: PartData, name: str, shares: dict[str, float]) -> PartData:
    """The part with a group that takes back shares of others."""
    field = np.zeros((len(part.points), 3), np.float32)
    for g in part.groups:
        field[g.ids] -= np.float32(shares.get(g.name, 0.0)) * g.moves
    return _with_group(part, name, field)


def _with_group(part: PartData, name: str, field: Floats32) -> PartData:
    ids = np.flatnonzero(np.abs(field).max(axis=1) > 1e-3).astype(np.int32)
    return replace(part, groups=[*part.groups, Group(name, ids, field[ids])]) if len(ids) else part
