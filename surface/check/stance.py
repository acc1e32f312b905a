"""Check a head's size, its place before the camera, its eyes, and that no part is inside out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32
from surface.check.findings import AGAIN, Finding
from surface.check.lids import eye_opening
from surface.check.mouth import Mouth
from surface.check.raster import NOTHING, Picture, View, view_rotation
from surface.check.subject import HAIR, SIDES, Subject
from surface.view.scene.camera import Camera

EYES_RANGE_MM = (30.0, 140.0)  # distance between the eyes of any head that is in millimetres
HEIGHT_RANGE_MM = (90.0, 900.0)  # height of its skin
MAX_OFFSET = 0.95  # of eyes and mouth from the picture's middle; 1 is its edge
MAX_OFF_PIVOT = 0.6  # distance of an eyeball's middle from its pivot, in its radii
VIEWS = (0.0, 38.0, -38.0, 90.0, -90.0, 180.0)  # yaw of the views of a head, degrees
POSES: tuple[dict[str, float], ...] = ({}, {"jawOpen": 1.0})
MAX_BACK = 0.6  # fraction of a part's visible pixels that may show its back
MIN_PIXELS = 60
SOLID = ("teeth", "gums", "tongue", "eye")  # materials of parts that are seen from outside only


def wrong_unit(subject: Subject) -> Iterator[Finding]:
    """Find a head that is far too big or too small to be one in millimetres."""
    if subject.eyes is not None:
        size, (low, high), what = float(np.linalg.norm(subject.eyes[0] - subject.eyes[1])), EYES_RANGE_MM, "eyes are"
    else:
        size, (low, high), what = subject.height, HEIGHT_RANGE_MM, "skin is"
    if not low <= size <= high:
        word = "apart" if subject.eyes is not None else "high"
        text = f"the {what} {size:.3g} mm {word}; a head has {low:.0f} to {high:.0f} mm"
        hint = "omote fit MESH -o {folder} --unit UNIT, with the unit of the mesh (mm, cm, m, in)"
        yield Finding("wrong unit", text, hint)


def off_camera(subject: Subject, mouth: Mouth | None) -> Iterator[Finding]:
    """Find a face that the front camera does not see, or sees from behind."""
    marks = _face_landmarks(subject, mouth)
    clip = np.column_stack([marks, np.ones(len(marks))]) @ np.asarray(Camera.front().matrix(1.0), float).T
    behind = bool((clip[:, 3] <= 0).any())
    at = clip[:, :2] / np.maximum(np.abs(clip[:, 3:]), 1e-9)
    hint = f"{AGAIN}, with --up and --forward if the axes of the mesh were guessed wrong"
    if behind or np.abs(at).max() > MAX_OFFSET:
        middle = ", ".join(f"{v:.0f}" for v in marks.mean(axis=0))
        yield Finding("off camera", f"the face is not in the front camera's picture: it lies at ({middle}) mm", hint)
    elif not _faces_forward(subject):
        yield Finding("off camera", "the front camera sees the back of the head", hint)


def missing_eyes(subject: Subject) -> Iterator[Finding]:
    """Find eyeballs that are not there, not where they turn, or that nobody sees."""
    present = [subject.eye(side) is not None for side in (0, 1)]
    if not any(present) and subject.eyes is None:
        text = "the head has no eyes: gaze will not show"
        yield Finding("missing eye", text, f"export the mesh with its eyeballs, then {AGAIN}", warning=True)
        return
    for side, word in enumerate(("left", "right")):
        if not present[side]:
            text = f"no part follows {SIDES[side]}: the {word} eye is a hole"
            yield Finding("missing eye", text, f"export the mesh with both eyeballs, then {AGAIN}")
        elif (off := _off_pivot(subject, side)) > MAX_OFF_PIVOT * subject.head.data.eye_radius:
            text = f"the {word} eyeball lies {off:.1f} mm from the point about which it turns"
            yield Finding("missing eye", text, "correct pivots.eyes in head.toml")
        elif eye_opening(subject, side, subject.rest) == 0.0:
            text = f"nothing of the {word} eyeball can be seen from the front"
            yield Finding("missing eye", text, f"check where the mesh has its eyes, then {AGAIN}")


def inside_out(subject: Subject) -> Iterator[Finding]:
    """Find parts that show their back: by the way their triangles run, or by their normals."""
    seen = np.zeros(len(subject.parts))
    backs = np.zeros((2, len(subject.parts)))
    for values in POSES:
        vertices = subject.posed_now(values)
        normals = [p.normals.copy() for p in subject.parts]
        for yaw in VIEWS:
            picture = _picture(subject, vertices, yaw)
            for k, (shown, by_way, by_normal) in _sides_shown(subject, picture, vertices, normals).items():
                seen[k] += shown
                backs[:, k] += by_way, by_normal
    subject.posed_now({})
    for k, part in enumerate(subject.parts):
        if seen[k] < MIN_PIXELS and part.material in SOLID:
            seen[k], *backs[:, k] = _sides_shown_alone(subject, k)
    for part, count, (by_way, by_normal) in zip(subject.parts, seen, backs.T, strict=True):
        if count >= MIN_PIXELS and max(by_way, by_normal) > MAX_BACK * count:
            what = "triangles run" if by_way > MAX_BACK * count else "normals point"
            text = f"part {part.name!r}: its {what} inwards, {100 * max(by_way, by_normal) / count:.0f} % of what shows"
            yield Finding("inside-out part", text, f"make all faces of the mesh look outwards, then {AGAIN}")


def _sides_shown_alone(subject: Subject, number: int) -> tuple[int, int, int]:
    """Do the same as :func:`_sides_shown`, of one part that nothing else hides: only what is no lining shows its
    outside then."""
    picture = _picture(subject, [v if k == number else v[:0] for k, v in enumerate(subject.rest)], 0.0)
    normals = [p.normals for p in subject.parts]
    return _sides_shown(subject, picture, subject.rest, normals).get(number, (0, 0, 0))


def _sides_shown(
    subject: Subject, picture: Picture, vertices: list[Floats32], normals: list[Floats32]
) -> dict[int, tuple[int, int, int]]:  # fmt: skip
    """By number of part: pixels that show it, and how many of them show its back, by its triangles and its normals."""
    toward = picture.view.turn[2]
    out = {}
    for k in np.unique(picture.parts[picture.parts != NOTHING]):
        rows = picture.rows[picture.parts == k]
        corner = subject.parts[k].triangles[rows]
        at = vertices[k][corner].astype(np.float64)
        flat = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]) @ toward
        smooth = normals[k][corner].mean(axis=1) @ toward
        out[int(k)] = len(rows), int((flat < 0).sum()), int((smooth < 0).sum())
    return out


def _picture(subject: Subject, vertices: list[Floats32], yaw: float) -> Picture:
    turn, step = view_rotation(yaw), 1.2 * subject.scale
    at = np.concatenate(vertices) @ turn.T
    low, high = at.min(axis=0), at.max(axis=0)
    most = 600 * step  # a head of any size makes a picture of a size that can be drawn
    view = View((low[0], min(high[0], low[0] + most)), (low[1], min(high[1], low[1] + most)), step, turn)
    shapes = subject.shapes(vertices, without=HAIR)
    return view.draw([s if s is not None and len(s[0]) else None for s in shapes])


def _faces_forward(subject: Subject) -> bool:
    """Whether the skin that moves most, the face, lies in front of the rest."""
    moves = np.zeros(sum(len(subject.rest[k]) for k in subject.skin))
    for name in subject.claimed:
        if not name.startswith(("head", "leftEye", "rightEye")):
            own = subject.moves(name)
            moves += np.concatenate([np.linalg.norm(own[k], axis=1) for k in subject.skin])
    z = np.concatenate([subject.rest[k][:, 2] for k in subject.skin]).astype(np.float64)
    if not moves.any():
        return True
    return float(moves @ z / moves.sum()) >= float(z.min() + 0.35 * np.ptp(z))


def _face_landmarks(subject: Subject, mouth: Mouth | None) -> Floats:
    """Return (k, 3): places of the face: eyes and mouth, or the middle of the skin's front."""
    marks = [] if subject.eyes is None else list(subject.eyes)
    marks += [] if mouth is None else [mouth.middle]
    if marks:
        return np.array(marks)
    at = np.concatenate([subject.rest[k] for k in subject.skin]).astype(np.float64)
    front: Bools = at[:, 2] >= np.quantile(at[:, 2], 0.9)
    middle: Floats = at[front].mean(axis=0, keepdims=True)
    return middle


def _off_pivot(subject: Subject, side: int) -> float:
    number = subject.eye(side)
    assert number is not None
    at = subject.rest[number].astype(np.float64)
    away = 0.5 * (at.min(axis=0) + at.max(axis=0)) - subject.head.data.eyes[side]
    return float(np.linalg.norm(away[:2]))  # an eyeball may be a half shell: its depth says nothing
