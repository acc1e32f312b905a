"""Find the eyes of a mesh without a recipe: where they turn, how large they are, which faces are theirs.

What names say comes first, then balls that mirror each other, then patches of the face between the lids, and at last
the openings between the lids, which eyeballs are fitted into.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.eyes.linings import linings
from surface.fit.eyes.margins import margins
from surface.fit.eyes.names import is_beside
from surface.fit.eyes.openings import Opening, ball_behind, find_openings
from surface.fit.eyes.patches import LOOKS, island_sides, shaped_sides, turns
from surface.fit.eyes.pieces import Side, around, named_sides, pieces_of, round_sides
from surface.fit.eyes.sockets import hidden_faces
from surface.fit.points.ballfit import Ball, turning_centre
from surface.fit.source.mesh import FitMesh

MISSING = (
    "no eyes were found and none are drawn: name the pieces that are eyes EyeLeft and EyeRight, leave out what hides "
    "them (--without glasses, for example), or cut the eyes open"
)
ADDED = "the mesh has no eyes: eyeballs were fitted into the openings between its lids"
SAME_CENTRE = 0.04  # of the radius: a pivot this near to the sphere's centre is that centre
MAX_OFFSET = 0.4  # of the radius: a pivot further from the sphere's centre is not trusted


@dataclass(frozen=True)
class Eyes:
    """Both eyes of a mesh.

    centres : (2, 3) about which they turn, left first, mm; radius : mm, 0 without eyes.
    faces : (f,) bool, faces of the mesh that are eyes and no skin.
    drawn : (f,) bool, those of ``faces`` that are no sockets. skin : (f,) bool, faces of the face.
    iris : radius of the iris, mm; 0 where no piece shows it.
    openings : between the lids, left first; empty where they are not holes of the skin.
    notes : what was found, in words. flat : they were patches and no balls, as of drawn characters.
    """

    centres: Floats
    radius: float
    faces: Bools
    drawn: Bools
    skin: Bools
    iris: float = 0.0
    openings: list[Opening] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    flat: bool = False


def find_eyes(mesh: FitMesh, skin_of: Callable[[Bools], Bools]) -> Eyes:
    """Find both eyes.

    skin_of : which faces (f,) are skin, once those (f,) that are eyes are left out.
    """
    near = blink_middles(mesh)
    middle = float(near[:, 0].mean()) if near is not None else middle_x(mesh)
    kept = np.array([is_beside(name) for name in mesh.pieces], bool)
    sides, what, gone = _piece_sides(mesh, middle, near, kept)
    skin = skin_of(gone)
    if not sides:
        sides, what = shaped_sides(mesh, skin, near), "patches of the face"
        sides = sides or island_sides(mesh, skin, middle, near)
        gone = _mask(mesh, sides)
        skin = skin_of(gone) if sides else skin
    if not skin.any():
        return Eyes(np.zeros((2, 3)), 0.0, gone, gone, skin, notes=[MISSING])
    found = replace(_placed(mesh, sides, what, gone, find_openings(mesh, skin, middle, near)), skin=skin)
    return _without_margins(mesh, _without_sockets(mesh, found, skin, middle, near), middle, near)


def _without_sockets(mesh: FitMesh, eyes: Eyes, skin: Bools, middle: float, near: Floats | None) -> Eyes:
    """The eyes, to whose faces those of sockets behind them are added, where that opens the skin between the lids."""
    if eyes.radius <= 0 or eyes.openings:
        return eyes
    behind = eyes.faces.copy()
    for side, centre in zip(("Left", "Right"), eyes.centres, strict=True):
        behind[hidden_faces(mesh, skin, centre, eyes.radius)] = True
        behind[linings(mesh, skin & ~behind, centre, eyes.radius, side)] = True
    count = int((behind & skin).sum())
    openings = find_openings(mesh, skin & ~behind, middle, near) if count else []
    if not openings:
        return eyes
    notes = [*eyes.notes, f"{count} faces of sockets behind the eyes are left out"]
    return replace(eyes, faces=behind, skin=skin & ~behind, openings=openings, notes=notes)


def _without_margins(mesh: FitMesh, eyes: Eyes, middle: float, near: Floats | None) -> Eyes:
    """The eyes, to whose faces those of margins are added that would be crushed on the eyeballs."""
    if eyes.radius <= 0 or not eyes.openings:
        return eyes
    crushed = np.zeros(len(mesh.faces), bool)
    crushed[margins(mesh, eyes.skin, eyes.centres, eyes.radius)] = True
    openings = find_openings(mesh, eyes.skin & ~crushed, middle, near) if crushed.any() else []
    if not openings:
        return eyes
    notes = [*eyes.notes, f"{int(crushed.sum())} faces of lids' margins inside the eyeballs are left out"]
    skin = eyes.skin & ~crushed
    return replace(eyes, faces=eyes.faces | crushed, skin=skin, openings=openings, notes=notes)


def _piece_sides(mesh: FitMesh, middle: float, near: Floats | None, kept: Bools) -> tuple[list[Side], str, Bools]:
    """Eyes that are pieces, words on how they were recognised, and all faces in them."""
    sides = named_sides(mesh, middle)
    what = "pieces named as eyes"
    pieces = pieces_of(mesh, np.arange(len(mesh.faces)))
    own = [p for p in pieces if not (len(kept) and kept[mesh.piece[p.faces[0]]])]
    if not sides:
        sides, what = round_sides(own, middle, near), "balls that mirror each other"
    gone = _mask(mesh, sides)
    gone[around(own, sides)] = True
    return sides, what, gone


def _mask(mesh: FitMesh, sides: list[Side]) -> Bools:
    out = np.zeros(len(mesh.faces), bool)
    for side in sides:
        out[side.faces] = True
    return out


def _placed(mesh: FitMesh, sides: list[Side], what: str, gone: Bools, openings: list[Opening]) -> Eyes:
    """Eyes out of what was found; those without a sphere, or not found at all, are fitted into the openings."""
    if sides and all(s.ball is not None for s in sides):
        balls, how = [_turned(mesh, s, k) for k, s in enumerate(sides)], "exact ones"
    elif openings:
        flat: list[Floats | None] = [s.middle for s in sides] if sides else [None, None]
        apart = float(np.linalg.norm(openings[0].middle - openings[1].middle))
        balls = [ball_behind(mesh, o, at, apart) for o, at in zip(openings, flat, strict=True)]
        how = "eyeballs that fill the openings between the lids"
    elif sides:
        balls, how = _behind_flat(sides), "eyeballs behind them"
    else:
        return Eyes(np.zeros((2, 3)), 0.0, gone, gone, gone, notes=[MISSING])
    radius = float(np.mean([b.radius for b in balls]))
    notes = [f"{int(gone.sum())} faces are eyes ({what}), replaced by {how}"] if sides else [ADDED]
    iris = max((s.iris for s in sides), default=0.0)
    patches = any(s.ball is None for s in sides)
    return Eyes(np.stack([b.centre for b in balls]), radius, gone, gone, gone, iris, openings, notes, patches)


def _turned(mesh: FitMesh, side: Side, index: int) -> Ball:
    """A side's sphere about the point that its shapes turn it about, if they do and it is believable."""
    if side.ball is None:
        raise ValueError("a flat eye has no sphere")
    name = ("Left", "Right")[index]
    centre = turning_centre(turns(mesh, side.faces, [f"{n}{name}" for n in LOOKS if f"{n}{name}" in mesh.names]))
    off = np.inf if centre is None else float(np.linalg.norm(centre - side.ball.centre))
    if centre is None or not SAME_CENTRE * side.ball.radius < off < MAX_OFFSET * side.ball.radius:
        return side.ball
    front = side.points[(side.points - centre)[:, 2] > 0.5 * side.ball.radius]
    return replace(side.ball, centre=centre, radius=float(np.median(np.linalg.norm(front - centre, axis=1))))


def _behind_flat(sides: list[Side]) -> list[Ball]:
    """Eyeballs as large as people's behind flat eyes in a face without openings."""
    radius = 0.19 * float(np.linalg.norm(sides[0].middle - sides[1].middle))
    return [Ball(s.middle - [0.0, 0.0, radius], radius, 0.0, 1.0) for s in sides]


def blink_middles(mesh: FitMesh) -> Floats | None:
    """(2, 3) the middles of what blinks, left first; None where a shape is missing or both are one."""
    found = []
    for name in ("eyeBlinkLeft", "eyeBlinkRight"):
        move = mesh.deltas[mesh.names.index(name)] if name in mesh.names else np.zeros((len(mesh.vertices), 3))
        weight = (move**2).sum(axis=1)
        if not weight.sum() > 0:
            return None
        found.append(weight @ mesh.vertices / weight.sum())
    left, right = sorted(found, key=lambda at: -at[0])
    return np.stack([left, right]) if left[0] > right[0] else None


def middle_x(mesh: FitMesh) -> float:
    """x of the plane half-way between the leftmost and the rightmost vertex."""
    return float(0.5 * (mesh.vertices[:, 0].min() + mesh.vertices[:, 0].max()))
