"""Find axes and unit of a mesh file: from options, from its format, else from eyes, mouth and size of the head."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.errors import FitError
from surface.fit.source.placing.anatomy import Eyes, Landmarks, find_landmarks, in_order, middle_of
from surface.fit.source.placing.conventions import Convention
from surface.fit.source.placing.match import match_face
from surface.fit.source.placing.orient import SQUARE, Orientation, axis_names, in_front, orient, snapped
from surface.head.model.placement import Placement

UNITS = {"mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
AXES = {f"{sign}{'xyz'[i]}": (i, -1.0 if sign else 1.0) for i in range(3) for sign in ("", "-")}
HEAD_HEIGHT_MM = 250.0  # a head with neck; enough to distinguish units by the height
EYES_MM = 65.4  # between the middles of what blinks, on the head that the bounds were set for
HEIGHT_MM = 338.0  # of the whole head that the bounds were set for
MAX_GUESSED_RATIO = 1.6  # of the size of a head in a guessed unit to the usual size, and of the usual to that size
EYES_AT = np.array([0.0, 36.1, 84.2])  # middle between the eyeballs' centres of the shipped head, mm
HALF_APART = np.array([[31.8, 0.0, 0.0], [-31.8, 0.0, 0.0]])  # from there to each
MOUTH_AT = np.array([0.0, -35.9, 102.3])  # middle of what its lips' shapes move
MAX_DEFINED_RATIO = 2.5  # the same in a unit that the file format defines: figures may be large


@dataclass(frozen=True)
class Frame:
    """Transformation of a file's coordinates to millimetres, y up, z forward, x to the subject's left: rotation
    ``turn`` (3, 3) and ``scale`` in mm per unit, whose name is ``unit``, empty for none that is known. ``notes`` say
    what was guessed; ``marks`` are the landmarks found in the file's coordinates."""

    turn: Floats
    scale: float
    notes: tuple[str, ...] = ()
    unit: str = ""
    marks: Landmarks = field(default_factory=Landmarks)

    @property
    def placement(self) -> Placement:
        """The same without a shift."""
        return Placement(self.turn, self.scale, np.zeros(3), self.unit)

    def points(self, rows: Floats) -> Floats:
        """Points or displacements (..., 3) in head space, before any shift."""
        return self.placement.moves(rows)


def find_frame(
    vertices: Floats, shapes: dict[str, Floats], *, unit: str | None = None, up: str | None = None,
    forward: str | None = None, faces: Ints | None = None, convention: Convention = Convention(),
    known: Placement | None = None,
) -> Frame:  # fmt: skip
    """Find axes and unit: as given, else as the format defines where the head's anatomy does not contradict it, else
    by eyes, mouth and size of the head.

    shapes : displacements (n, 3) by ARKit's names; see :func:`surface.fit.source.placing.anatomy.find_landmarks`.
    unit : one of :data:`UNITS`; up, forward : x, y, z, -x, -y or -z. convention : what the format defines.
    known : how the file lies, where it says so itself; unit, up and forward go before it.

    Raises FitError: an unknown word, or up and forward along one axis.
    """
    notes: list[str] = []
    if unit is not None and unit not in UNITS:
        raise FitError(f"--unit {unit}: is not one of {', '.join(UNITS)}", hint="--unit cm")
    marks = find_landmarks(vertices, np.zeros((0, 4), np.int64) if faces is None else faces, shapes)
    if faces is not None and orient(vertices, marks) is None:
        marks = _by_form(vertices, faces, marks, notes)
    if known is not None and not (unit or up or forward):
        return Frame(known.turn, known.scale, tuple(notes), known.unit, marks)
    turn = _turn(vertices, shapes, marks, up, forward, convention, notes)
    height = float(np.ptp(vertices @ turn[1]))
    scale, name = _scale(marks.eyes, height, unit, convention, notes)
    return Frame(turn, scale, tuple(notes), name, marks)


def _by_form(vertices: Floats, faces: Ints, marks: Landmarks, notes: list[str]) -> Landmarks:
    """Landmarks with eyes and mouth of a face that is found by its form; as they are where none is."""
    face = match_face(vertices, faces)
    if face is None:
        return marks
    eyes = Eyes(face.at(EYES_AT + HALF_APART), True, True, "the form of the face")
    if marks.eyes is not None and np.linalg.norm(marks.eyes.middle - eyes.middle) < 0.5 * eyes.apart:
        eyes = replace(marks.eyes, centres=in_order(marks.eyes.centres, eyes.centres), sided=True)
    notes.append("the face was found by its form: no shapes of lids and lips show where it is")
    return replace(marks, eyes=eyes, mouth=face.at(MOUTH_AT))


def eye_distance(vertices: Floats, shapes: dict[str, Floats]) -> float:
    """Distance between the centres of both blink shapes; 0 where one is missing."""
    left, right = (middle_of(vertices, shapes.get(n)) for n in ("eyeBlinkLeft", "eyeBlinkRight"))
    return float(np.linalg.norm(left - right)) if left is not None and right is not None else 0.0


def head_scale(vertices: Floats, shapes: dict[str, Floats]) -> float:
    """Size of a head (mm) relative to the one that the bounds were set for: by its eyes, else by its height."""
    between = eye_distance(vertices, shapes)
    return between / EYES_MM if between else float(np.ptp(vertices[:, 1])) / HEIGHT_MM


def _scale(
    eyes: Eyes | None, height: float, by_user: str | None, convention: Convention, notes: list[str]
) -> tuple[float, str]:  # fmt: skip
    """mm per unit, and the unit's name; ``height`` is that of the whole mesh, in the file's unit."""
    measure, usual = (eyes.apart, EYES_MM) if eyes else (height, HEAD_HEIGHT_MM)

    def words(scale: float) -> str:
        what = "its eyes are {:.3g} mm apart" if eyes else "all of it is {:.3g} mm high"
        return what.format(scale * measure)

    def off(scale: float) -> float:
        return float(np.exp(abs(np.log(max(scale * measure, 1e-12) / usual))))

    given = by_user or convention.unit
    if given and (by_user or off(UNITS[given]) <= (MAX_DEFINED_RATIO if eyes else 12.0)):
        if by_user and eyes and off(UNITS[given]) > MAX_DEFINED_RATIO:
            notes.append(f"with --unit {given} {words(UNITS[given])}, a human's {EYES_MM:.0f}")
        return UNITS[given], given
    why = f"although {convention.by} defines {convention.unit}, since then {words(UNITS[given])}" if given else ""
    guess = min(UNITS, key=lambda u: off(UNITS[u]))
    if off(UNITS[guess]) > MAX_GUESSED_RATIO and eyes:
        why = f", {why}" if why else ""
        notes.append(f"no usual unit fits{why}: its eyes are taken to be {EYES_MM:.0f} mm apart (say --unit otherwise)")
        return usual / measure, ""
    notes.append(f"unit taken to be {guess}{', ' + why if why else ''}: {words(UNITS[guess])} (say --unit otherwise)")
    return UNITS[guess], guess


def _turn(
    vertices: Floats, shapes: dict[str, Floats], marks: Landmarks, up: str | None, forward: str | None,
    convention: Convention, notes: list[str],
) -> Floats:  # fmt: skip
    """The rotation to head space, (3, 3): as the user says, as defined, as found, or as is usual, in this order."""
    found = orient(vertices, marks)
    usual = _square(convention.up or "y", convention.forward or "z")
    if up or forward:
        turn = _by_options(up, forward, found, usual)
    elif found is None:
        turn = _partly(vertices, shapes, marks, usual, sure=bool(convention.by))
    else:
        turn = found.turn if _differ(found, usual) else usual
        notes += found.notes
    _say(turn, convention, found, by_user=bool(up or forward), notes=notes)
    return turn


def _differ(found: Orientation, usual: Floats) -> bool:
    """Whether what was found is another rotation than the usual one."""
    return not found.upright or not np.allclose(found.turn, usual)


def _say(turn: Floats, convention: Convention, found: Orientation | None, *, by_user: bool, notes: list[str]) -> None:
    """Note a rotation that a user would not expect."""
    square = bool(np.isclose(np.abs(turn).max(axis=1), 1.0).all())
    said = convention.by and np.allclose(turn, _square(convention.up, convention.forward))
    if said or (np.array_equal(turn, np.eye(3)) and not convention.by):
        return
    but = f", although {convention.by} defines {convention.up} and {convention.forward}" if convention.by else ""
    why = "" if by_user or found is None else " by eyes and mouth (say --up and --forward otherwise)"
    if square:
        up, forward = axis_names(turn)
        notes.append(f"turned: up is {up}, forward is {forward} in the file{but}{why}")
        return
    angle = np.degrees(np.arccos(np.clip(0.5 * (np.trace(turn) - 1.0), -1.0, 1.0)))
    notes.append(f"levelled: the head stands askew in the file, by {angle:.0f} degrees{but}{why}")


def _by_options(up: str | None, forward: str | None, found: Orientation | None, usual: Floats) -> Floats:
    """The rotation with the axes given; the one that is not given is as found, else the usual one."""
    guess = usual if found is None else snapped(found.turn).turn
    if not np.isclose(np.abs(guess).max(axis=1), 1.0).all():
        guess = max(SQUARE, key=lambda t: float((t * guess).sum()))
    y = _axis("--up", up) if up else guess[1]
    z = _axis("--forward", forward) if forward else guess[2]
    if abs(y @ z) > 0.5 and not (up and forward):  # the other one must give way
        spare = usual[2] if abs(y @ usual[2]) < 0.5 else (np.array([0.0, -1.0, 0.0]) if up else usual[1])
        y, z = (y, spare) if up else (spare if abs(spare @ z) < 0.5 else np.array([0.0, 0.0, 1.0]), z)
    if abs(y @ z) > 0.5:
        raise FitError("--up and --forward lie along one axis", hint="--up z --forward -y, for example")
    return np.stack([np.cross(y, z), y, z])


def _square(up: str, forward: str) -> Floats:
    y, z = _axis("up", up), _axis("forward", forward)
    return np.stack([np.cross(y, z), y, z])


def _axis(option: str, name: str) -> Floats:
    if name not in AXES:
        raise FitError(f"{option} {name}: is not one of {', '.join(AXES)}", hint=f"{option} y")
    index, sign = AXES[name]
    axis: Floats = sign * np.eye(3)[index]
    return axis


def _partly(vertices: Floats, shapes: dict[str, Floats], marks: Landmarks, usual: Floats, *, sure: bool) -> Floats:
    """A rotation by 90 degrees that agrees with what little is known, as near to the usual one as possible."""
    if sure:
        return usual
    known: list[Floats] = list(SQUARE)
    if marks.eyes is not None:
        axis = marks.eyes.centres[0] - marks.eyes.centres[1]
        known = [t for t in known if abs(t[0] @ axis) > 0.9 * marks.eyes.apart] or known
        known = [t for t in known if in_front(vertices, marks.eyes, t[2]) > 0] or known
    if marks.left is not None:
        known = [t for t in known if t[0] @ marks.left > 0.7] or known
    if "jawOpen" in shapes:
        down = shapes["jawOpen"].sum(axis=0)
        known = [t for t in known if t[1] @ down < -0.6 * np.linalg.norm(down)] or known
    return max(known, key=lambda t: float((t * usual).sum()))
