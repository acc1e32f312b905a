"""Find parameters that move nothing or the wrong side, and blinks that do not close an eye."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from surface.base.arrays import Floats
from surface.check.findings import AGAIN, Finding
from surface.check.lids import eye_opening
from surface.check.subject import Subject
from surface.head.model.parameters import SHAPES

MIN_MOVE_MM = 0.1  # a parameter that moves nothing further than this has no effect
ASIDE = 0.06  # distance from the middle at which a side begins, in distances between the eyes
SHUT_MM = 0.5  # maximum visible height of an eye in a blink
OPEN_MM = 1.0  # minimum visible height of an open eye
ACROSS = ("jaw", "mouth")  # names whose Left or Right is the direction of motion; of all others it is the place


def empty_shapes(subject: Subject) -> Iterator[Finding]:
    """Find parameters that the head has a group or a joint for, and that move nothing of their own."""
    for name in subject.claimed:
        most = max(float(np.abs(m).max(initial=0.0)) for m in subject.moves(name))
        if most < MIN_MOVE_MM * subject.scale or _is_idle(subject, name):
            text = f"{name} = 1 moves nothing, though the head has something of that name"
            yield Finding("empty shape", text, f"export the mesh with this shape, then {AGAIN}")


def _is_idle(subject: Subject, name: str) -> bool:
    """Whether the head has groups of that name, none of which moves anything, and no joint of it."""
    groups = [g for p in subject.head.data.parts for g in p.groups if g.name == name]
    joint = name == "jawOpen" and subject.head.data.jaw.angle_rad > 0
    most = max((float(np.abs(g.moves).max(initial=0.0)) for g in groups), default=np.inf)
    return most < MIN_MOVE_MM * subject.scale and not joint


def swapped_sides(subject: Subject) -> Iterator[Finding]:
    """Find parameters of one side that move the other. Left is the subject's, at greater x."""
    middle, apart = _middle(subject)
    wrong = []
    for name in subject.claimed:
        offset = _direction(subject, name) if _goes_across(name) else _mean_offset(subject, name, middle) / apart
        if offset * _side_of(name) < -ASIDE:
            wrong.append(name)
    if wrong:
        more = f" and {len(wrong) - 4} more" if len(wrong) > 5 else ""
        names = ", ".join(wrong[: 4 if more else 5]) + more
        text = f"{names}: the other side of the face moves, or it moves to the other side (left is the subject's)"
        yield Finding("swapped sides", text, f"exchange the names of the left and right shapes, then {AGAIN}")
    if subject.eyes is not None and subject.eyes[0, 0] < subject.eyes[1, 0]:
        hint = "exchange the two rows of pivots.eyes in head.toml"
        yield Finding("swapped sides", "the left eye lies to the right of the right one", hint)


def blind_lids(subject: Subject) -> Iterator[Finding]:
    """Find eyes that a blink does not close."""
    names = ("eyeBlinkLeft", "eyeBlinkRight")
    any_blink = any(n in subject.claimed for n in names)
    for side, name in enumerate(names):
        opening = eye_opening(subject, side, subject.rest)
        if opening < OPEN_MM * subject.scale:
            continue
        if name not in subject.claimed:
            text = f"the head has no {name}: the eye stays {opening:.1f} mm open"
            hint = f"{AGAIN} --expressions-from ict, or export the mesh with a shape that closes the eyes"
            yield Finding("blind lid", text, hint, warning=not any_blink)
            continue
        left = eye_opening(subject, side, subject.at_one(name))
        if left > SHUT_MM * subject.scale:
            text = f"{name} = 1 leaves the eye {left:.1f} mm open (at rest {opening:.1f} mm; 0.5 mm at most)"
            yield Finding("blind lid", text, f"make the shape close the lids, then {AGAIN}")


def _side_of(name: str) -> int:
    """Return 1 for a parameter of the left side, -1 of the right, 0 of neither."""
    left = name.endswith("Left") or name.startswith("leftEye")
    right = name.endswith("Right") or name.startswith("rightEye")
    return int(left) - int(right)


def _goes_across(name: str) -> bool:
    return name in SHAPES and name.removesuffix("Left").removesuffix("Right") in ACROSS


def _middle(subject: Subject) -> tuple[float, float]:
    """Return x of the middle of the face, and the distance between the eyes, mm."""
    if subject.eyes is not None:
        return float(subject.eyes[:, 0].mean()), max(float(np.ptp(subject.eyes[:, 0])), 1e-6)
    xs = np.concatenate([subject.rest[k][:, 0] for k in subject.skin] or [np.zeros(2)])
    return float(0.5 * (xs.min() + xs.max())), max(0.35 * float(np.ptp(xs)), 1e-6)


def _mean_offset(subject: Subject, name: str, middle: float) -> float:
    """Return how far from the middle the vertices lie that a parameter moves, mm, weighted by how far they move."""
    moves = [np.linalg.norm(m, axis=1) for m in subject.moves(name)]
    total = sum(float(m.sum()) for m in moves)
    along = sum(float(m @ v[:, 0]) for m, v in zip(moves, subject.rest, strict=True))
    return along / total - middle if total > 0 else 0.0


def _direction(subject: Subject, name: str) -> float:
    """Return the fraction, -1..1, of a parameter's motion that goes to the subject's left."""
    moves: Floats = np.concatenate(subject.moves(name)).astype(np.float64)
    total = float(np.linalg.norm(moves, axis=1).sum())
    return float(moves[:, 0].sum()) / total if total > 0 else 0.0
