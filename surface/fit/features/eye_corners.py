"""Flesh between the lids' rims and the eyeballs, so that nobody looks past an eyeball into the head at its corners.

A band goes from the rim of each opening back into the eyeball. Along the lids, which lie on the eyeball, all of it is
inside; in the corners, where skin stands off a ball, it shows as the flesh that people have there. It is sewn to the
rim and moves with it in every shape.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.eyes.colours import piece_colour, white_colour
from surface.fit.eyes.search import Eyes
from surface.fit.features.pieces import HeadRig, Skin, Strip, fit_strip, strips_part
from surface.fit.points.refine import Fitted
from surface.fit.source.chart import TILE, Chart
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import PartData, Seam
from surface.head.posing.paint import BASE

NAME = "eye_corners"  # no lining that contacts take along: they would lift its end out of the eyeball
BACK = 0.35  # in radii: how far behind the rim the band aims
INSIDE = 0.9  # of the radius: where it ends
ACROSS = 4  # samples from the rim to its end
ALONG = (44, 3)  # control points along and across
CHORD_MM = 0.2  # of a head of usual size
FINER = 4  # samples between two places of the rim
REACH = 1.7  # in radii, from the eye's centre to the middle of its opening
FLESH, AMOUNT = [0.58, 0.25, 0.20], 0.7  # linear RGB, and how much of it covers the colour of skin
LIGHT = 0.7  # that baked shade leaves at least


def corners_part(
    face: str, chart: Chart, fitted: Fitted, mesh: FitMesh, rig: HeadRig, scale: float
) -> tuple[PartData, list[Seam]] | None:  # fmt: skip
    """The bands behind both openings as one part, and their seams with the face; None without an opening."""
    skin, strips, seams = Skin(fitted), list[Strip](), list[Seam]()
    for eye in rig.eyes:
        rim = _rim(chart, skin, mesh, eye, rig.radius)
        if rim is None:
            continue
        steps = np.linspace(0.0, 1.0, FINER * (len(rim) - 1) + 1)
        fine = [np.interp(steps, np.linspace(0.0, 1.0, len(rim)), rim[:, k]) for k in (0, 1)]
        at = skin.at(np.column_stack(fine))
        along = np.linspace(0.0, 1.0, len(rim))
        edge = np.concatenate([np.column_stack([along, np.zeros(len(rim))]), [[1.0, 1.0], [0.0, 1.0]]])
        shift = np.array([TILE * len(strips), 0.0])
        seams.append(Seam(face, NAME, rim, edge[: len(rim)] + shift))
        strips.append(fit_strip(_rows(at, eye, rig.radius), *ALONG, [edge]))
    if not strips:
        return None
    part = strips_part(NAME, "skin", strips, rig, (0, CHORD_MM * scale, 7))
    return replace(part, lids=np.zeros(len(part.points))), seams


def lacks_corners(loaded: Loaded) -> bool:
    """Whether nothing stays in a mesh that closes its corners of the eyes.

    An exported head has linings of its own, or bands by this name, which are left out as all pieces of eyes are, and
    made again.
    """
    return not loaded.exported or any(NAME in piece for piece in loaded.pieces)


def corners_paint(mesh: FitMesh, eyes: Eyes) -> list[dict[str, object]]:
    """The layers of paint that make the bands flesh; of flat eyes, as drawn characters have, the white of the eye.

    An export's get the colour that they had. Baked shade finds hardly any light behind a rim, and would make a dark gap
    of them.
    """
    given = piece_colour(mesh, NAME)
    if given is None and eyes.flat:
        found = white_colour(mesh, eyes)
        given = np.array(BASE["sclera"]) if found is None else found
    colour = _layer("albedo", FLESH) | {"amount": AMOUNT}
    colour = colour if given is None else _layer("albedo", np.round(given, 4).tolist())
    return [colour, _layer("occlusion_floor", [LIGHT])]


def _layer(attribute: str, value: list[float]) -> dict[str, object]:
    return {"part": NAME, "attribute": attribute, "kind": "all", "value": value}


def _rim(chart: Chart, skin: Skin, mesh: FitMesh, eye: Floats, radius: float) -> Floats | None:
    """(k, 2) the rim of an eye's opening in (u, v), its first place again at the end, counterclockwise as seen from the
    front; None where no hole is before the eye."""
    if len(chart.loops) < 2:
        return None
    hole = chart.hole_near(mesh.vertices, eye)
    loop = chart.loops[hole]
    middle = mesh.vertices[chart.loop_vertices[hole]].mean(axis=0)
    if np.linalg.norm(middle - eye) > REACH * radius:
        return None
    x, y = (skin.at(loop)[0] - eye)[:, :2].T
    turn = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    loop = loop if turn > 0 else loop[::-1]
    start = int(np.argmax(np.abs(x if turn > 0 else x[::-1])))  # the ends of the band meet in a corner
    loop = np.roll(loop, -start, axis=0)
    return np.concatenate([loop, loop[:1]])


def _rows(at: Floats, eye: Floats, radius: float) -> Floats:
    """(1 + k, m, ACROSS, 3) from rims (1 + k, m, 3) into an eyeball."""
    aim = at - eye - np.array([0.0, 0.0, BACK * radius])
    end = eye + INSIDE * radius * aim / np.maximum(np.linalg.norm(aim, axis=2, keepdims=True), 1e-9)
    share = np.linspace(0.0, 1.0, ACROSS)[:, None]
    rows: Floats = (1.0 - share) * at[:, :, None] + share * end[:, :, None]
    return rows
