"""Correct the blinks of a head whose eyes have got another form, so that they close the eyes again.

Blinks are scaled column by column of the lids, according to the gap that is still open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from surface.base.arrays import Floats
from surface.head import Contact, Group, HeadData, PartData
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import NAMES, read_pose
from surface.head.posing.rig import SkinRig

SIDES = (("left_lids", "eyeBlinkLeft"), ("right_lids", "eyeBlinkRight"))
TRIES, STEP, RANGE = 8, 0.8, (-0.3, 1.5)  # iterations; share of the gap closed in each; least and most change
SHORT_MM = 1.0  # columns where the lids travel less than this, near the corners, are changed less


def close_lids(head: HeadData, source: HeadData) -> HeadData:
    """The head with blinks that leave gaps no larger than in ``source``, the head that the expressions come from."""
    for contact, (name, shape) in ((c, s) for c in head.contacts for s in SIDES if c.name == s[0]):
        edges = _edges(head, contact)
        own = next(c for c in source.contacts if c.name == name)
        wanted = _gap(source, own, _edges(source, own), shape, 1.0)[1] * head.eye_radius / source.eye_radius
        x, open_ = _gap(head, contact, edges, shape, 0.0)
        travel, share = open_ - wanted, np.zeros(len(x))
        best, least = head, np.inf
        for _ in range(TRIES):
            trial = _with_share(head, shape, x, share)
            left = _gap(trial, contact, edges, shape, 1.0)[1] - wanted
            if (off := float((left + 0.2 * np.abs(left)).max())) < least:
                least, best = off, trial
            share = np.clip(share + STEP * left * travel / (travel**2 + SHORT_MM**2), *RANGE)
        head = best
    return head


def _face(head: HeadData, contact: Contact) -> PartData:
    return next(p for p in head.parts if p.name == contact.part)


def _edges(head: HeadData, contact: Contact) -> csr_matrix:
    """Weights of the face's control points at the contact's samples, (samples, control points) sparse."""
    return make_surface(_face(head, contact)).basis_matrix(contact.places.reshape(-1, 2))


def _gap(head: HeadData, contact: Contact, edges: csr_matrix, shape: str, value: float) -> tuple[Floats, Floats]:
    """x of the columns of two lids at rest, and the gap of each column where ``shape`` has ``value``, both (k,) mm.

    The gap is the height of the upper lid's lowest sample above the lower lid's highest one.
    """
    face = _face(head, contact)
    values = np.array([value if n == shape else 0.0 for n in NAMES])
    alone = replace(head, contacts=[contact])  # the other contacts are too far away to matter, and would cost time
    at = edges @ SkinRig(face, alone).apply(read_pose(values))
    rest = (edges @ face.points).reshape(*contact.places.shape[:3], 3)
    upper, lower = np.asarray(at).reshape(*contact.places.shape[:3], 3)
    touching = upper.shape[1] * 2 // 3
    x = rest[:, :, 0, 0].mean(axis=0)
    return x, upper[:, :touching, 1].min(axis=1) - lower[:, :touching, 1].max(axis=1)


def _with_share(head: HeadData, shape: str, x: Floats, share: Floats) -> HeadData:
    """The head with the displacements of a shape enlarged by ``share (k,)`` at ``x (k,)``, interpolated between."""
    order = np.argsort(x)

    def enlarged(part: PartData, g: Group) -> Group:
        more = 1.0 + np.interp(part.points[g.ids, 0], x[order], share[order])
        return Group(g.name, g.ids, (more[:, None] * g.moves).astype(np.float32))

    parts = [replace(p, groups=[enlarged(p, g) if g.name == shape else g for g in p.groups]) for p in head.parts]
    return replace(head, parts=parts)
