"""Defects seeded into a good head: each takes the data of a head and gives a worse one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from surface.head import Head
from surface.head.model.data import Group, HeadData, PartData


def with_part(head: HeadData, name: str, **changed: object) -> HeadData:
    """The head with fields of one part changed."""
    return replace(head, parts=[replace(p, **changed) if p.name == name else p for p in head.parts])


def part_of(head: HeadData, name: str) -> PartData:
    return next(p for p in head.parts if p.name == name)


def with_groups(head: HeadData, change: Callable[[Group], Group | None]) -> HeadData:
    """The head with every group of every part changed, or dropped where that gives None."""
    parts = [replace(p, groups=[g for each in p.groups if (g := change(each))]) for p in head.parts]
    return replace(head, parts=parts)


def scaled_group(head: HeadData, name: str, factor: float) -> HeadData:
    return with_groups(head, lambda g: replace(g, moves=g.moves * np.float32(factor)) if g.name == name else g)


def spike_at_rest(head: HeadData, mm: float = 200.0) -> HeadData:
    """One fine control point of the left cheek pulled out of the face."""
    face = head.parts[0]
    points = face.points.copy()
    points[fine_point(face, (52.0, -22.0, 92.0))] += np.array([0.5, 0.0, 0.8]) * mm
    return with_part(head, face.name, points=points)


def spike_in_a_pose(head: HeadData, name: str = "mouthSmileLeft", mm: float = 90.0) -> HeadData:
    """One control point of the left cheek that a shape throws out of the face."""
    face = head.parts[0]
    own = next(g for g in face.groups if g.name == name)
    moves = np.zeros((len(face.points), 3), np.float32)
    moves[own.ids] = own.moves
    moves[fine_point(face, (45.0, -20.0, 95.0))] += np.array([0.5, 0.0, 0.8], np.float32) * mm
    ids = np.flatnonzero(np.abs(moves).max(axis=1) > 0).astype(np.int32)
    groups = [Group(name, ids, moves[ids]) if g is own else g for g in face.groups]
    return with_part(head, face.name, groups=groups)


def fine_point(face: PartData, place: tuple[float, float, float]) -> int:
    """The control point near a place, within 12 mm, that reaches least far."""
    span = np.ptp(face.knots_u, axis=1) + np.ptp(face.knots_v, axis=1)
    far = np.linalg.norm(face.points - np.array(place), axis=1) > 12.0
    return int(np.argmin(span + 1e3 * far))


def without_an_eye(head: HeadData) -> HeadData:
    return replace(head, parts=[p for p in head.parts if p.follows != "left_eye"])


def weak_blink(head: HeadData) -> HeadData:
    return scaled_group(head, "eyeBlinkLeft", 0.5)


def swapped(head: HeadData) -> HeadData:
    """Left and right exchanged in the names of groups."""

    def other(group: Group) -> Group:
        return replace(group, name=group.name.replace("Left", "@").replace("Right", "Left").replace("@", "Right"))

    return with_groups(head, other)


def hole_of_triangles(head: HeadData) -> HeadData:
    """Triangles of the left cheek left out of the stored mesh."""
    face, posed = head.parts[0], Head(head).parts[0]
    middle = posed.vertices[face.mesh["mesh_triangles"]].mean(axis=1)
    kept = np.linalg.norm(middle - np.array([50.0, -20.0, 85.0]), axis=1) > 7.0
    return with_part(head, face.name, mesh=face.mesh | {"mesh_triangles": face.mesh["mesh_triangles"][kept]})


def hole_of_a_loop(head: HeadData) -> HeadData:
    """One more loop that trims the face, at the forehead."""
    face, posed = head.parts[0], Head(head).parts[0]
    centre = posed.uv[np.linalg.norm(posed.vertices - np.array([25.0, 85.0, 100.0]), axis=1).argmin()]
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    loop = centre + 0.012 * np.column_stack([np.cos(angle), np.sin(angle)])
    return with_part(head, face.name, loops=[*face.loops, loop], mesh={})


def scaled(head: HeadData, factor: float | tuple[float, float, float]) -> HeadData:
    """The head in another unit, or of other proportions."""
    f = np.broadcast_to(np.asarray(factor, float), 3)
    neck, jaw = head.neck, head.jaw
    turn = np.diag(f)
    tilts = {n: np.column_stack([turn @ t[:, :3] @ np.linalg.inv(turn), t[:, 3] * f]) for n, t in jaw.tilts.items()}
    return replace(
        head, eyes=head.eyes * f, eye_radius=float(head.eye_radius * f[1]),
        neck=replace(neck, pivot=triple(np.array(neck.pivot) * f), still=neck.still * f[1], whole=neck.whole * f[1]),
        jaw=replace(jaw, centre=triple(np.array(jaw.centre) * f), glide=triple(np.array(jaw.glide) * f), tilts=tilts),
        contacts=[replace(c, reach_mm=c.reach_mm * float(f[1])) for c in head.contacts],
        parts=[
            replace(
                p, points=p.points * f, groups=[replace(g, moves=(g.moves * f).astype(np.float32)) for g in p.groups]
            )
            for p in head.parts
        ],
    )  # fmt: skip


def moved(head: HeadData, shift: tuple[float, float, float]) -> HeadData:
    """The whole head somewhere else."""
    by = np.array(shift)
    neck, jaw = head.neck, head.jaw
    up = float(by[1] + neck.slope * by[2])
    return replace(
        head, eyes=head.eyes + by, parts=[replace(p, points=p.points + by) for p in head.parts],
        neck=replace(neck, pivot=triple(np.array(neck.pivot) + by), still=neck.still + up, whole=neck.whole + up),
        jaw=replace(jaw, centre=triple(np.array(jaw.centre) + by)),
    )  # fmt: skip


def turned_round(head: HeadData) -> HeadData:
    """The head with its back to the camera."""
    f = np.array([-1.0, 1.0, -1.0])
    return replace(
        head, eyes=(head.eyes * f)[::-1].copy(),
        parts=[replace(p, points=p.points * f, groups=[replace(g, moves=(g.moves * f).astype(np.float32))
               for g in p.groups]) for p in head.parts],
    )  # fmt: skip


def triple(row: np.ndarray) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])


def empty_shape(head: HeadData) -> HeadData:
    return scaled_group(head, "browInnerUp", 0.0)


def inside_out_part(head: HeadData, name: str = "face") -> HeadData:
    """The part's triangles run the other way round."""
    part = part_of(head, name)
    triangles = part.mesh["mesh_triangles"][:, ::-1].copy()
    return with_part(head, name, mesh=part.mesh | {"mesh_triangles": triangles})


def open_lips(head: HeadData, mm: float = 4.0) -> HeadData:
    """Everything that follows the jaw lower."""
    return replace(
        head, parts=[replace(p, points=p.points - np.outer(p.jaw, [0.0, mm, 0.0])) for p in head.parts]
    )  # fmt: skip


def weak_mouth_close(head: HeadData) -> HeadData:
    weak = scaled_group(head, "mouthClose", 0.8)
    return replace(weak, contacts=[replace(c, seal=None) for c in weak.contacts])  # which would close them all the same


def without_parts(head: HeadData, *names: str) -> HeadData:
    """The head less some parts and what belongs to them."""
    return replace(
        head, parts=[p for p in head.parts if p.name not in names],
        seams=[s for s in head.seams if not {s.part_a, s.part_b} & {*names}],
        contacts=[replace(c, followers=tuple(f for f in c.followers if f not in names)) for c in head.contacts],
        paint=[row for row in head.paint if row.get("part") not in names],
    )  # fmt: skip


def swollen_eye(head: HeadData, factor: float = 1.3) -> HeadData:
    """The left eyeball bigger than its socket: it comes through the lids."""
    eye = part_of(head, "eye_left")
    return with_part(head, "eye_left", points=head.eyes[0] + factor * (eye.points - head.eyes[0]))
