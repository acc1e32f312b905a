"""Give a head the form of a scan: skin, groups and pivots are moved by the registration's map, eyes with the eyeballs,
teeth as rigid bodies; contacts reach as far as the eyeballs' size says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.transfer.align import face_region
from surface.fit.transfer.detail.front import on_front
from surface.fit.transfer.detail.together import brought_together, sides_of
from surface.fit.transfer.eye_depth import at_scan_depth
from surface.fit.transfer.place_parts import behind_skin, place_eyes, place_jaw, place_neck, place_teeth
from surface.fit.transfer.register import Matcher
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.skin import (
    Ball,
    Skin,
    behind_lids,
    close_lips,
    follow_skin,
    rims_of,
    seat_on_eyeballs,
    uncross,
)
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp
from surface.head import Contact, Group, Head, HeadData, PartData
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.model.parameters import read_pose
from surface.head.posing.rig import SkinRig

REACH_MM = 3.0  # distance to either side over which rotation and stretch of a displacement are measured
STRETCH = (0.6, 1.6)  # least and greatest stretch of a displacement
RIGID = ("teeth", "gums", "tongue")
SOCKETS = "sockets"
CONTACT_PASSES = 2
LONGEST_MM = 2.2  # of the edges of triangles that follow a scan's detail


def warp_head(
    head: Head, template: Template, warp: Warp, smooth: Warp, matcher: Matcher, shown: Samples,
    provenance: dict[str, str], name: str,
) -> HeadData:  # fmt: skip
    """The head in the form that a map of space and the scan's detail give it.

    smooth : a stiffer map, by which displacements are rotated and stretched. matcher : finds the scan's detail.
    shown : samples of the scan that are in sight from outside.
    """
    data = head.data
    front = shown.kept(on_front(warp(template.points[face_region(template)]), shown))
    old, new = Ball(data.eyes, data.eye_radius), Ball(*place_eyes(template, warp))
    skins = _skins(head, warp, smooth, matcher, front, old, new)
    lips = next(c for c in data.contacts if c.name == "lips")
    face = skins[lips.part]
    new = at_scan_depth(template, face.at, face.rest, face.mesh.triangles, new, front.points)
    finer = _solved(head, skins, lips, old, new)
    crowns = [p.vertices for p in head.parts if p.material == "teeth"]
    teeth = place_teeth(head, warp)
    if crowns:
        teeth = behind_skin(teeth, np.concatenate(crowns).astype(float), face.rest, face.at)
    parts = []
    for part in (finer.get(p.name, p) for p in data.parts):
        if part.follows in ("left_eye", "right_eye"):
            side = int(part.follows == "right_eye")
            points = new.centres[side] + new.radius / old.radius * (part.points - old.centres[side])
        elif part.material in RIGID:
            points = teeth.points(part.points)
        elif part.name in skins:
            points = skins[part.name].points
        elif part.name == SOCKETS:
            points = behind_lids(part.points, face, old, new)
        else:
            points = seat_on_eyeballs(follow_skin(part.points, face, warp), part.points, old, new)
        linear = np.tile(teeth.scale * np.eye(3), (len(points), 1, 1))
        if part.material not in RIGID and part.follows == "skin":
            linear = stretches(smooth, part.points)
        parts.append(_with_points(part, points, linear))
    scale = new.radius / old.radius
    warped = replace(
        data, name=name, provenance=provenance, neck=place_neck(data, template, warp), eyes=new.centres,
        eye_radius=new.radius, jaw=place_jaw(data, warp), parts=parts,
        contacts=[replace(c, reach_mm=scale * c.reach_mm) for c in data.contacts],
    )  # fmt: skip
    return with_triangles(with_contacts_solved(warped), tuple(skins))


def _skins(
    head: Head, warp: Warp, smooth: Warp, matcher: Matcher, front: Samples, old: Ball, new: Ball
) -> dict[str, Skin]:  # fmt: skip
    """The visible parts of skin, moved onto the scan and with one border at every seam, by name; lids are not yet on
    the eyeballs.

    front : samples of the scan on the front of the face.
    """
    rims, scale = rims_of(head), new.radius / old.radius
    lips = next(c for c in head.data.contacts if c.name == "lips")
    out = {}
    for part in head.parts:
        if part.follows == "skin" and part.material == "skin" and part.name != SOCKETS:
            skin = Skin(part, rims, warp, old, LONGEST_MM * scale)
            skin.follow(matcher, scale)
            skin.round_off(front, head.data.neck, scale)
            if part.name == lips.part:
                skin.cover(matcher, front, scale)
            out[part.name] = skin
    sides = sides_of({p.name: p for p in head.parts if p.name in out}, head.data.seams)
    for name, (ids, places) in brought_together({n: skin.at for n, skin in out.items()}, sides).items():
        out[name].pull(ids, places)
    uncross(list(out.values()), smooth, front, scale)
    return out


def _solved(head: Head, skins: dict[str, Skin], lips: Contact, old: Ball, new: Ball) -> dict[str, PartData]:
    """The parts of the head that skins belong to, with as many control points as they need; the skins get their control
    points, with lids on the eyeballs and closed lips."""
    data, finer = {p.name: p for p in head.data.parts}, {}
    for name, skin in skins.items():
        skin.at = seat_on_eyeballs(skin.at, skin.rest, old, new)
        finer[name] = skin.solve(data[name], head.data.jaw)
        if name == lips.part:
            close_lips(skin, lips, new.radius / old.radius)
    return finer


def stretches(warp: Warp, points: Floats) -> Floats:
    """(n, 3, 3) matrices that rotate and stretch displacements: the map's derivatives, without reflections
    and with stretches limited to STRETCH."""
    u, size, vt = np.linalg.svd(warp.jacobians(points, REACH_MM))
    sign = np.linalg.det(u @ vt)
    u[sign < 0, :, 2] *= -1.0
    linear: Floats = np.einsum("nij,nj,njk->nik", u, np.clip(size, *STRETCH), vt)
    return linear


def _with_points(part: PartData, points: Floats, linear: Floats) -> PartData:
    """The part with control points at ``points (n, 3)``, its displacements multiplied by ``linear (n, 3, 3)``."""
    groups = []
    for g in part.groups:
        moves = np.einsum("nij,nj->ni", linear[g.ids], g.moves)
        groups.append(Group(g.name, g.ids, np.round(moves, 4).astype(np.float32)))
    return replace(part, points=points, groups=groups)


def with_contacts_solved(head: HeadData) -> HeadData:
    """The head with its points at rest where solving its contacts at rest puts them."""
    rest = read_pose(np.zeros(59))
    for _ in range(CONTACT_PASSES):
        points = [SkinRig(p, head).apply(rest).copy() if p.follows == "skin" else p.points for p in head.parts]
        head = replace(head, parts=[replace(p, points=at) for p, at in zip(head.parts, points, strict=True)])
    return head


def with_triangles(head: HeadData, names: Sequence[str]) -> HeadData:
    """The head whose parts of these names are tessellated anew: they bend elsewhere than in the form they had."""

    def drawn(part: PartData) -> PartData:
        mesh = tessellate(part, make_surface(part), head.seams)
        return replace(part, mesh=pack(mesh, part.budget))

    return replace(head, parts=[drawn(p) if p.name in names else p for p in head.parts])
