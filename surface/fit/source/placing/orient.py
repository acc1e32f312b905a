"""Find which way a head looks and which way is up: from its eyes, its mouth and the form of its face."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.placing.anatomy import Eyes, Landmarks

#: Angle (degrees) from straight up, towards the front, of the line from lips or jaw to the eyes of an upright head:
#: (eyes found as balls, or on the lids). Measured on the shipped head.
TILT = {"mouth": (-13.9, -6.0), "jaw": (-3.2, 3.7)}
LEVEL_DEG = 4.0  # a head whose left lies nearer to an axis is upright as it is: its own small asymmetry
PITCH_DEG = 30.0  # and whose face is pitched by less: stylised faces differ by as much
MAX_BACKWARD = -0.15  # in distances of the eyes, or depths of the mesh: eyes further behind its middle look backwards
EYE_REGION = 1.6  # radius of what is around the eyes, in distances of the eyes


@dataclass(frozen=True)
class Orientation:
    """turn : (3, 3) rotation, rows are left, up and forward in the file. upright : whether all three are axes of the
    file. notes : what was seen, in words."""

    turn: Floats
    upright: bool
    notes: tuple[str, ...] = ()


def orient(vertices: Floats, marks: Landmarks) -> Orientation | None:
    """Orientation by landmarks; None where they do not give one: without eyes, or with nothing below them."""
    eyes, low = marks.eyes, marks.mouth if marks.mouth is not None else marks.jaw
    if eyes is None or low is None:
        return None
    return oriented_by(vertices, eyes, low, TILT["mouth" if marks.mouth is not None else "jaw"][not eyes.balls])


def oriented_by(vertices: Floats, eyes: Eyes, low: Floats, tilt_deg: float) -> Orientation | None:
    """Orientation by two eyes and a point ``low`` (3,) of lips or jaw, whose line leans forward by ``tilt_deg``."""
    left, notes = _unit(eyes.centres[0] - eyes.centres[1]), tuple[str, ...]()
    up = eyes.middle - low
    up = up - (up @ left) * left
    if np.linalg.norm(up) < 0.3 * eyes.apart:  # eyes beside the mouth: one of them is no eye or no mouth
        return None
    up = _unit(up)
    if _behind(vertices, eyes, np.cross(left, up)):
        left, notes = -left, (("left and right shapes are named as the viewer sees them",) if eyes.sided else ())
    forward, lean = np.cross(left, up), np.radians(tilt_deg)
    turn = np.stack([left, np.cos(lean) * up - np.sin(lean) * forward, np.cos(lean) * forward + np.sin(lean) * up])
    return snapped(turn, notes)


def _behind(vertices: Floats, eyes: Eyes, forward: Floats) -> bool:
    """Whether the eyes look the other way: at the back of what is around them, else at the back of the whole mesh."""
    front = in_front(vertices, eyes, forward)
    if abs(front) > -MAX_BACKWARD * eyes.apart:
        return front < 0
    depth = vertices @ forward
    return float(eyes.middle @ forward - 0.5 * (depth.min() + depth.max())) < MAX_BACKWARD * float(np.ptp(depth))


def in_front(vertices: Floats, eyes: Eyes, forward: Floats) -> float:
    """How far the eyes are in front of the middle of what lies around them, along ``forward``; negative: behind."""
    depth = vertices[np.linalg.norm(vertices - eyes.middle, axis=1) < EYE_REGION * eyes.apart] @ forward
    return float(eyes.middle @ forward - 0.5 * (depth.min() + depth.max())) if len(depth) else 0.0


def snapped(turn: Floats, notes: tuple[str, ...] = ()) -> Orientation:
    """The nearest rotation by 90 degrees where the head is upright in the file; else ``turn`` itself, which levels it.

    How far a face is pitched is known only roughly: where left is an axis and the pitch is small, it stays as it is.
    """
    square = max(SQUARE, key=lambda t: float((t * turn).sum()))
    off = np.degrees(np.arccos(np.clip(turn[0] @ square[0], -1.0, 1.0)))
    pitch = np.degrees(np.arccos(np.clip(turn[1] @ square[1], -1.0, 1.0)))
    if off < LEVEL_DEG and pitch < PITCH_DEG:
        return Orientation(square, True, notes)
    return Orientation(turn, False, notes)


def axis_names(turn: Floats) -> tuple[str, str]:
    """Names of the file's axes that point up and forward in a rotation by 90 degrees."""
    names = [f"{'-' if row[np.argmax(np.abs(row))] < 0 else ''}{'xyz'[int(np.argmax(np.abs(row)))]}" for row in turn]
    return names[1], names[2]


def shapes_of_sides(sources: Mapping[str, list[tuple[int, str]]], deltas: Floats) -> dict[str, Floats]:
    """Displacements (n, 3) by ARKit's names for :func:`surface.fit.source.placing.anatomy.find_landmarks`.

    sources : (index, side) of the shapes that make each parameter; what would be cut into sides, which needs the axes,
    is given whole under the name without a side.
    """
    out: dict[str, Floats] = {}
    for name, every in sources.items():
        base = name.removesuffix("Left").removesuffix("Right") if any(side for _, side in every) else name
        if base not in out and all(0 <= i < len(deltas) for i, _ in every):
            out[base] = deltas[[i for i, _ in every]].sum(axis=0)
    return out


def _unit(vector: Floats) -> Floats:
    out: Floats = vector / max(float(np.linalg.norm(vector)), 1e-30)
    return out


def _square() -> Floats:
    """(24, 3, 3) all rotations that map axes onto axes."""
    signs = [np.array(s)[:, None] for s in product((1, -1), repeat=3)]
    signed = [np.eye(3)[list(p)] * s for p in permutations(range(3)) for s in signs]
    return np.stack([t for t in signed if np.linalg.det(t) > 0])


SQUARE = _square()
