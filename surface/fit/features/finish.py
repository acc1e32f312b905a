"""What is put on top of a fitted head: wrinkles, contacts of lips and lids, correctives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.fit.features.contacts import find_contacts
from surface.fit.features.correctives import add_correctives
from surface.fit.features.rigging import DROOP, DROOP_RULE
from surface.fit.features.wrinkles import add_wrinkles
from surface.fit.points.recipe import Recipe
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import HeadData
from surface.head.model.parameters import read_pose
from surface.head.posing.rig import SkinRig

SETTLINGS = 4  # each moves what is left by half


def finish_head(head: HeadData, mesh: FitMesh, charts: dict[str, Chart], recipe: Recipe) -> HeadData:
    """The head with wrinkles, contacts and correctives; neutral becomes what contacts make of it."""
    face = next((p for p in head.parts if p.follows == "skin" and len(p.slits) and p.name in charts), None)
    if face is None:
        return head
    rules = [DROOP_RULE] if any(g.name == DROOP for p in head.parts for g in p.groups) else []
    wrinkled, folds = add_wrinkles(face, charts[face.name], mesh, recipe.wrinkles)
    names = tuple(p.name for p in head.parts)
    contacts = find_contacts(wrinkled, head.eyes, head.eye_radius, names)
    parts = [wrinkled if p is face else p for p in head.parts]
    head = add_correctives(replace(head, parts=parts, rules=[*rules, *folds], contacts=contacts), recipe.correctives)
    for _ in range(SETTLINGS):
        head = _settled(head)
    return head


def _settled(head: HeadData) -> HeadData:
    """The head whose parts stand at rest where contacts put them."""
    rest = read_pose(np.zeros(59))
    settled = [SkinRig(p, head).apply(rest).copy() if p.follows == "skin" else p.points for p in head.parts]
    return replace(head, parts=[replace(p, points=at) for p, at in zip(head.parts, settled, strict=True)])
