"""Reduce the head whose expressions are transferred to what a scanner would see of it, and find its landmarks.

A scanner sees skin and the fronts of the eyeballs. That surface, the template, is then registered to the scan. Openings
are those of the mouth and of the eyelids.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError
from surface.head import Contact, Head, HeadData, HeadPart
from surface.head.model.data import Neck

SIDES = ("left", "right")
NAMES = (
    "nose_tip", "nose_bridge", "chin", "left_eye_inner", "left_eye_outer", "left_eye_upper", "left_eye_lower",
    "right_eye_inner", "right_eye_outer", "right_eye_upper", "right_eye_lower", "mouth_left", "mouth_right",
    "upper_lip", "lower_lip",
)  # fmt: skip
EYE_FRONT = 0.3  # in radii: what lies further in front of an eyeball's centre may be visible between the lids
PROFILE_MM = 2.0  # from the plane of symmetry: greatest distance of vertices that belong to the profile
HEIGHT_MM = 3.0  # tolerance of a height at which a point of the profile is sought


@dataclass(frozen=True)
class Template:
    """Points (n, 3), unit normals (n, 3) and triangles (t, 3) of a head at rest as seen from outside, mm.

    face : (n,) whether a point belongs to the part of skin that has the openings. eye : (n,) 0 or 1 on the front of the
    left or right eyeball, else -1.
    landmarks : places (3,) by the names of :data:`NAMES`. eyes : (2, 3) centres of the eyeballs, mm. radius : of each
    eyeball, mm. neck : how the head's neck bends; None where nothing is known of one.
    """

    points: Floats
    normals: Floats
    triangles: Ints
    face: Bools
    eye: Ints
    landmarks: dict[str, Floats]
    eyes: Floats
    radius: float
    neck: Neck | None = None

    @property
    def height(self) -> float:
        """From the chin to the bridge of the nose, mm: the unit for lengths that depend on the size of a head."""
        return float(self.landmarks["nose_bridge"][1] - self.landmarks["chin"][1])


def make_template(head: Head, where: str) -> Template:
    """Pose a head at rest and reduce it to a template.

    where : what the user gave as the head, for messages.

    Raises FitError: the head lacks eyes, or openings of mouth and lids.
    """
    head.pose(head.values({}))
    data = head.data
    contacts = {c.name: c for c in data.contacts}
    if data.eye_radius <= 0 or not {"lips", "left_lids", "right_lids"} <= set(contacts):
        raise FitError(f"--expressions-from {where}: the head has no eyes, or no openings of mouth and lids",
                       hint="take one that has them, such as ict")  # fmt: skip
    rows = [_visible_surface(p, data, contacts["lips"].part) for p in head.parts]
    rows = [r for r in rows if len(r[2])]
    first = np.cumsum([0, *(len(r[0]) for r in rows)])
    points, normals, _, face, eye = (np.concatenate([r[k] for r in rows]) for k in range(5))
    triangles = np.concatenate([r[2] + k for r, k in zip(rows, first, strict=False)])
    marks = find_landmarks(head, contacts)
    return Template(points, normals, triangles, face, eye, marks, data.eyes.copy(), data.eye_radius, data.neck)


def _visible_surface(part: HeadPart, data: HeadData, face: str) -> tuple[Floats, Floats, Ints, Bools, Ints]:
    """Points, normals and triangles of the visible surface of a part, and their ``face`` and ``eye`` of a Template;
    ``face`` : name of the part with the openings."""
    n, tri = len(part.vertices), part.triangles.astype(np.int64)
    side = ("left_eye", "right_eye").index(part.follows) if part.follows in ("left_eye", "right_eye") else -1
    if side >= 0:
        kept = part.vertices[:, 2] > data.eyes[side, 2] + EYE_FRONT * data.eye_radius
    else:
        kept = np.full(n, part.follows == "skin" and part.material == "skin" and part.name != "sockets")
    place = np.cumsum(kept) - 1
    tri = place[tri[kept[tri].all(axis=1)]]
    at, out = part.vertices[kept].astype(float), part.normals[kept].astype(float)
    return at, out, tri, np.full(len(at), part.name == face), np.full(len(at), side)


def find_landmarks(head: Head, contacts: dict[str, Contact]) -> dict[str, Floats]:
    """The landmarks of a head at rest, from the rims of its openings and its profile."""
    surface = head.part(contacts["lips"].part).surface
    rims = {n: surface.evaluate(c.places[:, :, 0].reshape(-1, 2)).reshape(2, -1, 3) for n, c in contacts.items()}
    out: dict[str, Floats] = {}
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        rim = rims[f"{side}_lids"]
        ends = sorted((rim[:, 0].mean(axis=0), rim[:, -1].mean(axis=0)), key=lambda p: sign * p[0])
        out[f"{side}_eye_inner"], out[f"{side}_eye_outer"] = ends
        out[f"{side}_eye_upper"], out[f"{side}_eye_lower"] = rim[:, rim.shape[1] // 2]
    lips = rims["lips"]
    ends = sorted((lips[:, 0].mean(axis=0), lips[:, -1].mean(axis=0)), key=lambda p: -p[0])
    out["mouth_left"], out["mouth_right"] = ends
    skin = head.part(contacts["lips"].part)
    profile = skin.vertices[np.abs(skin.vertices[:, 0]) < PROFILE_MM].astype(float)
    eyes_y = float(np.mean([out["left_eye_upper"][1], out["right_eye_upper"][1]]))
    mouth_y = float(lips[:, :, 1].mean())
    eye_to_mouth = eyes_y - mouth_y
    between = profile[(profile[:, 1] < eyes_y) & (profile[:, 1] > mouth_y + 0.2 * eye_to_mouth)]
    tip = between[between[:, 2].argmax()]
    bridge = _at_height(profile, eyes_y)
    upper = _front(profile, mouth_y, mouth_y + 0.15 * eye_to_mouth)
    lower = _front(profile, mouth_y - 0.2 * eye_to_mouth, mouth_y)
    chin = _front(profile, mouth_y - 0.75 * eye_to_mouth, mouth_y - 0.4 * eye_to_mouth)
    return out | {"nose_tip": tip, "nose_bridge": bridge, "upper_lip": upper, "lower_lip": lower, "chin": chin}


def _front(profile: Floats, low: float, high: float) -> Floats:
    """The foremost point of a profile between two heights."""
    inside = profile[(profile[:, 1] >= low) & (profile[:, 1] <= high)]
    foremost: Floats = inside[inside[:, 2].argmax()]
    return foremost


def _at_height(profile: Floats, y: float) -> Floats:
    """The foremost point of a profile near a height."""
    return _front(profile, y - HEIGHT_MM, y + HEIGHT_MM)
