"""Find axes and unit of a mesh file: from options, else from the mesh's own shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
GUESSED = ("mm", "cm", "m")  # by the height; by the eyes inches, too: the height depends on how much neck there is
AXES = {f"{sign}{'xyz'[i]}": (i, -1.0 if sign else 1.0) for i in range(3) for sign in ("", "-")}
HEAD_HEIGHT_MM = 250.0  # a head with neck; enough to distinguish metres, centimetres and millimetres
EYES_MM = 65.4  # between the middles of what blinks, on the head that the bounds were set for
HEIGHT_MM = 338.0  # of that head
BEHIND = -0.15  # of the mesh's depth: shapes further behind its middle mean that left and right are swapped


@dataclass(frozen=True)
class Frame:
    """Transformation of a file's coordinates to millimetres, y up, z forward, x to the subject's left: rotation
    ``turn`` (3, 3) and ``scale`` in mm per unit. ``notes`` say what was guessed."""

    turn: Floats
    scale: float
    notes: tuple[str, ...] = ()

    def points(self, rows: Floats) -> Floats:
        """Points or displacements (..., 3) in head space."""
        return self.scale * (rows @ self.turn.T)


def find_frame(
    vertices: Floats, shapes: dict[str, Floats], *, unit: str | None = None, up: str | None = None,
    forward: str | None = None,
) -> Frame:  # fmt: skip
    """Find axes and unit: as given, else by the shapes, else y up, z forward and a head's usual height.

    shapes : displacements (n, 3) by ARKit's names.
    unit : one of :data:`UNITS`; up, forward : x, y, z, -x, -y or -z.

    Raises FitError: an unknown word, or up and forward along one axis.
    """
    notes: list[str] = []
    turn = _turn(vertices, shapes, up, forward, notes)
    if unit is not None:
        if unit not in UNITS:
            raise FitError(f"--unit {unit}: is not one of {', '.join(UNITS)}", hint="--unit cm")
        return Frame(turn, UNITS[unit], tuple(notes))
    turned = vertices @ turn.T
    eyes, height = eye_distance(turned, shapes), float(np.ptp(turned[:, 1]))
    measure, usual, units = (eyes, EYES_MM, (*GUESSED, "in")) if eyes else (height, HEAD_HEIGHT_MM, GUESSED)
    guess = min(units, key=lambda u: abs(np.log(max(measure * UNITS[u], 1e-12) / usual)))
    notes.append(f"unit taken for {guess}: all of it is {UNITS[guess] * height:.0f} mm high (say --unit otherwise)")
    return Frame(turn, UNITS[guess], tuple(notes))


def eye_distance(vertices: Floats, shapes: dict[str, Floats]) -> float:
    """Distance between the centres of both blink shapes; 0 where one is missing."""
    left, right = (_middle(vertices, shapes.get(n)) for n in ("eyeBlinkLeft", "eyeBlinkRight"))
    return float(np.linalg.norm(left - right)) if left is not None and right is not None else 0.0


def head_scale(vertices: Floats, shapes: dict[str, Floats]) -> float:
    """Size of a head (mm) relative to the one that the bounds were set for: by its eyes, else by its height."""
    between = eye_distance(vertices, shapes)
    return between / EYES_MM if between else float(np.ptp(vertices[:, 1])) / HEIGHT_MM


def _turn(vertices: Floats, shapes: dict[str, Floats], up: str | None, forward: str | None, notes: list[str]) -> Floats:
    guessed_up, guessed_left = _shape_axes(vertices, shapes)
    y = _axis("--up", up) if up else guessed_up if guessed_up is not None else np.array([0.0, 1.0, 0.0])
    if forward:
        z = _axis("--forward", forward)
    else:
        usual = np.array([0.0, 0.0, 1.0]) if abs(y[2]) < 0.5 else np.array([0.0, -1.0, 0.0])
        z = usual if guessed_left is None or abs(guessed_left @ y) > 0.5 else np.cross(guessed_left, y)
        z = _seen(vertices, shapes, z, notes)
    if abs(y @ z) > 0.5:
        raise FitError("--up and --forward lie along one axis", hint="--up z --forward -y, for example")
    turn = np.stack([np.cross(y, z), y, z])
    if not np.array_equal(turn, np.eye(3)):
        names = [next(n for n, (i, s) in AXES.items() if row[i] * s > 0.5) for row in turn[1:]]
        notes.append(f"turned: up is {names[0]}, forward is {names[1]} in the file")
    return turn


def _axis(option: str, name: str) -> Floats:
    if name not in AXES:
        raise FitError(f"{option} {name}: is not one of {', '.join(AXES)}", hint=f"{option} y")
    index, sign = AXES[name]
    axis: Floats = sign * np.eye(3)[index]
    return axis


def _shape_axes(vertices: Floats, shapes: dict[str, Floats]) -> tuple[Floats | None, Floats | None]:
    """Up, against the opening jaw; and left, from right shapes to left ones. None where shapes do not determine it."""
    left = np.zeros(3)
    for name in shapes:
        if "Left" in name and name[:3] not in ("jaw", "mou"):
            a, b = (_middle(vertices, shapes.get(n)) for n in (name, name.replace("Left", "Right")))
            left += a - b if a is not None and b is not None else 0.0
    up = -shapes["jawOpen"].sum(axis=0) if "jawOpen" in shapes else np.zeros(3)
    x = _nearest_axis(left)
    if x is not None:
        up = up * (np.abs(x) < 0.5)
    return _nearest_axis(up), x


def _seen(vertices: Floats, shapes: dict[str, Floats], z: Floats, notes: list[str]) -> Floats:
    """``z``, or its opposite where the face moves far behind the mesh's middle: then sides are named the other way."""
    middles = [m for move in shapes.values() if (m := _middle(vertices, move)) is not None]
    if not middles:
        return z
    depth = vertices @ z
    offset = float(np.mean(middles, axis=0) @ z - 0.5 * (depth.min() + depth.max()))
    if offset >= BEHIND * float(np.ptp(depth)):
        return z
    notes.append("left and right shapes seem to be named as the viewer sees them (say --forward to overrule)")
    return -z


def _middle(vertices: Floats, move: Floats | None) -> Floats | None:
    """Mean of the vertices, weighted by how far a shape moves them; None for one that moves nothing."""
    if move is None:
        return None
    weight = np.linalg.norm(move, axis=1)
    return weight @ vertices / weight.sum() if weight.sum() > 0 else None


def _nearest_axis(direction: Floats) -> Floats | None:
    if not np.linalg.norm(direction) > 0:
        return None
    index = int(np.argmax(np.abs(direction)))
    axis: Floats = np.sign(direction[index]) * np.eye(3)[index]
    return axis
