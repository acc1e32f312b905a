"""Let lashes move with the lids that they grow from, on a head that got another form.

Lashes stand away from the skin. There the map of space turns and stretches a displacement otherwise than at their
roots, and lids are corrected after it: a lid that shuts would leave its lashes behind, or cover them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.head import Group, Head, HeadData, PartData
from surface.head.model.face import face_of
from surface.head.model.meshes import make_surface

MATERIAL = "lash"
ROOT_MM = 1.5  # of the head that the expressions come from: control points this near to the skin are roots


def rooted_lashes(head: HeadData, source: Head) -> HeadData:
    """The head whose lashes move, relative to the skin at their roots, as those of ``source`` do, in every shape.

    head : in another form; its parts have the names of ``source``, and their surfaces the same (u, v).
    """
    skin = face_of(source.parts, source.data.contacts)
    if skin is None:
        return head
    old_face, new_face = (next(p for p in d.parts if p.name == skin.name) for d in (source.data, head))
    feet = make_surface(old_face).basis_matrix(skin.uv.astype(float)) @ old_face.points
    scale = head.eye_radius / source.data.eye_radius if source.data.eye_radius > 0 else 1.0
    old = {p.name: p for p in source.data.parts}

    def rooted(part: PartData) -> PartData:
        roots = skin.uv.astype(float)[_roots(old[part.name].points, feet)]
        at_old, at_new = (make_surface(face).basis_matrix(roots) for face in (old_face, new_face))
        groups = []
        for group in part.groups:
            beside = moves_of(old[part.name], group.name) - at_old @ moves_of(old_face, group.name)
            moves = at_new @ moves_of(new_face, group.name) + scale * beside
            groups.append(Group(group.name, np.arange(len(moves), dtype=np.int32), moves.astype(np.float32)))
        return replace(part, groups=groups)

    return replace(head, parts=[rooted(p) if p.material == MATERIAL else p for p in head.parts])


def moves_of(part: PartData, name: str) -> Floats:
    """How groups of a name move the control points of a part, (n, 3) mm."""
    out = np.zeros((len(part.points), 3))
    for group in part.groups:
        if group.name == name:
            out[group.ids] += group.moves
    return out


def _roots(points: Floats, skin: Floats) -> Ints:
    """For each control point (n, 3) of lashes the row of ``skin (m, 3)`` that its own hair grows from: that of the
    nearest point that is a root."""
    off, foot = cKDTree(skin).query(points)
    near = np.flatnonzero(off <= max(ROOT_MM, float(off.min(initial=np.inf))))
    rows: Ints = np.asarray(foot)[near][cKDTree(points[near]).query(points)[1]]
    return rows
