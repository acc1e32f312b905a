"""Finish a fitted head: add wrinkles, contacts of lips and lids, and corrective shapes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from surface.fit.features.contacts import find_contacts
from surface.fit.features.rigging import DROOP, DROOP_RULE
from surface.fit.features.wrinkles import add_wrinkles
from surface.fit.points.recipe import Recipe
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Group, HeadData, PartData, Rule
from surface.head.model.parameters import read_pose
from surface.head.posing.rig import SkinRig

SETTLINGS = 4  # each halves what contacts still move at rest


def finish_head(head: HeadData, mesh: FitMesh, charts: dict[str, Chart], recipe: Recipe) -> HeadData:
    """The head with wrinkles, contacts and correctives; its points at rest are those that contacts leave unchanged."""
    face = next((p for p in head.parts if p.follows == "skin" and len(p.slits) and p.name in charts), None)
    if face is None:
        return head
    rules = [DROOP_RULE] if any(g.name == DROOP for p in head.parts for g in p.groups) else []
    wrinkled, folds = add_wrinkles(face, charts[face.name], mesh, recipe.wrinkles)
    names = tuple(p.name for p in head.parts)
    contacts = find_contacts(wrinkled, head.eyes, head.eye_radius, names)
    parts = [wrinkled if p is face else p for p in head.parts]
    head = add_correctives(replace(head, parts=parts, rules=[*rules, *folds], contacts=contacts), recipe.correctives)
    rest = read_pose(np.zeros(59))
    for _ in range(SETTLINGS):
        points = [SkinRig(p, head).apply(rest).copy() if p.follows == "skin" else p.points for p in head.parts]
        head = replace(head, parts=[replace(p, points=at) for p, at in zip(head.parts, points, strict=True)])
    return head


def add_correctives(head: HeadData, wanted: list[dict[str, Any]]) -> HeadData:
    """The head with corrective shapes: groups for pairs of shapes that do not add up, worth the product of the two.

    Parameters
    ----------
    wanted : tables with ``shapes``, two of them; ``subtract``, shares of displacements of shapes that are taken back
        where both are whole.
    """
    for table in wanted:
        first, second = table["shapes"]
        rule = Rule(f"{first}*{second}", ({first: 1.0}, {second: 1.0}))
        parts = [_corrected(p, rule.group, table["subtract"]) for p in head.parts]
        head = replace(head, parts=parts, rules=[*head.rules, rule])
    return head


def _corrected(part: PartData, name: str, shares: dict[str, float]) -> PartData:
    """The part with a group that takes back shares of others, if that moves anything."""
    field = np.zeros((len(part.points), 3), np.float32)
    for g in part.groups:
        field[g.ids] -= np.float32(shares.get(g.name, 0.0)) * g.moves
    ids = np.flatnonzero(np.abs(field).max(axis=1) > 1e-3).astype(np.int32)
    return replace(part, groups=[*part.groups, Group(name, ids, field[ids])]) if len(ids) else part
