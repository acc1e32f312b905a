"""Place the parts of a head that are not skin in a new form: eyeballs, teeth, the jaw's hinge and the neck."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp
from surface.head import Group, Head, HeadData, Jaw, Neck, PartData

EYE_RADII = 1.5  # distance from an eyeball's centre, in radii, within which skin determines its new place
TEETH = ("teeth", "gums", "tongue")
FRONT_MM = 4.0  # distance behind the foremost teeth over which the weight of teeth in their placing falls to 1/e
FRONT_TEETH_MM = 20.0  # behind the foremost tooth: teeth that far back have lips or corners of the mouth before them
BESIDE_MM = 1.5  # greatest distance aside of the skin that lies before a place of a tooth


@dataclass(frozen=True)
class ScaleShift:
    """The map p -> scale * p + shift. It has no rotation, so that the jaw still turns about x."""

    scale: float
    shift: Floats

    def points(self, rows: Floats) -> Floats:
        """Points (..., 3) moved."""
        moved: Floats = self.scale * rows + self.shift
        return moved


def fit_scale_shift(points: Floats, goals: Floats, weight: Floats | None = None) -> ScaleShift:
    """The scale and shift that bring points (n, 3) nearest to goals (n, 3), in least squares with weights (n,)."""
    w = np.ones(len(points)) if weight is None else weight
    w = w / w.sum()
    a0, b0 = w @ points, w @ goals
    a, b = points - a0, goals - b0
    scale = float((w @ (a * b).sum(axis=1)) / max(float(w @ (a * a).sum(axis=1)), 1e-12))
    return ScaleShift(scale, b0 - scale * a0)


def place_eyes(template: Template, warp: Warp) -> tuple[Floats, float]:
    """New centres (2, 3) and radius of the eyeballs, from where the map puts their fronts and the lids around them."""
    found = []
    for side, eye in enumerate(template.eyes):
        own = template.eye == side
        around = template.face & (np.linalg.norm(template.points - eye, axis=1) < EYE_RADII * template.radius)
        points = template.points[own | around]
        found.append(fit_scale_shift(points, warp(points)))
    radius = template.radius * float(np.mean([p.scale for p in found]))
    centres = []
    for side, (eye, place) in enumerate(zip(template.eyes, found, strict=True)):
        front = template.points[template.eye == side]
        out = (front - eye) / template.radius  # in the mean, the ball touches its front where the map puts the front
        centre = place.points(eye)
        centre[2] = float(np.mean((warp(front) - radius * out)[:, 2]))
        centres.append(centre)
    return np.array(centres), radius


def place_teeth(head: Head, warp: Warp) -> ScaleShift:
    """How teeth, gums and tongue move, all together. Where the map puts all of them gives their size, and where it puts
    their front gives their place, because closed lips lie directly before it."""
    points = [p.vertices for p in head.parts if p.material in TEETH]
    if not points:
        points = [p.vertices for p in head.parts if p.material == "mouth"] or [head.parts[0].vertices]
    at = np.concatenate(points).astype(float)[::7]
    goals = warp(at)
    scale = fit_scale_shift(at, goals).scale
    front = np.exp((at[:, 2] - at[:, 2].max()) / FRONT_MM)
    return ScaleShift(scale, (front / front.sum()) @ (goals - scale * at))


def behind_skin(place: ScaleShift, teeth: Floats, before: Floats, after: Floats) -> ScaleShift:
    """How teeth move so that they lie at least as deep behind the skin as they did, relative to their size.

    The map of space does not know the scan's detail, which the skin follows afterwards: lips may come to lie in the
    teeth. place : how the teeth (k, 3) move by that map. before, after : (m, 3) the skin's vertices on the head that
    they come from and on the scan.
    """
    front = teeth[teeth[:, 2] > teeth[:, 2].max(initial=-np.inf) - FRONT_TEETH_MM]
    lack = place.scale * _depths(front, before, BESIDE_MM) - _depths(
        place.points(front), after, place.scale * BESIDE_MM
    )
    known = lack[np.isfinite(lack)]
    back = max(0.0, float(np.median(known))) if len(known) else 0.0
    return ScaleShift(place.scale, place.shift - [0.0, 0.0, back])


def _depths(points: Floats, skin: Floats, beside: float) -> Floats:
    """(k,) mm from points (k, 3) forward to the foremost vertex of skin (m, 3) that is no further aside than
    ``beside``; NaN where there is none."""
    near = cKDTree(skin[:, :2]).query_ball_point(points[:, :2], beside)
    return np.array([skin[n, 2].max() - z if n else np.nan for n, z in zip(near, points[:, 2], strict=True)])


def place_jaw(data: HeadData, warp: Warp) -> Jaw:
    """The jaw's motion in the new form: its hinge, glide and tilts are moved and scaled as the skin that follows it."""
    face = max((p for p in data.parts if p.follows == "skin"), key=lambda p: float(p.jaw.sum()))
    place = fit_scale_shift(face.points, warp(face.points), face.jaw + 1e-6)
    centre = place.points(np.array(data.jaw.centre))
    glide = place.scale * np.array(data.jaw.glide)
    tilts = {}
    for name, tilt in data.jaw.tilts.items():
        linear, move = np.asarray(tilt)[:, :3], np.asarray(tilt)[:, 3]
        tilts[name] = np.column_stack([linear, place.scale * move - linear @ place.shift])
    return Jaw(tuple(centre.tolist()), data.jaw.angle_rad, tuple(glide.tolist()), tilts)


def place_neck(data: HeadData, template: Template, warp: Warp) -> Neck:
    """The neck's pivot and bend in the new form."""
    points = template.points[::5]
    place, neck = fit_scale_shift(points, warp(points)), data.neck
    x, y, z = place.points(np.array(neck.pivot)).tolist()
    lift = float(place.shift[1] + neck.slope * place.shift[2])
    return Neck((x, y, z), neck.slope, place.scale * neck.still + lift, place.scale * neck.whole + lift)


def scaled(data: HeadData, factor: float, middle: Floats) -> HeadData:
    """A head enlarged by ``factor`` about ``middle (3,)``; the error allowed for its triangles (mm) stays the same."""

    def moved(p: Floats) -> Floats:
        out: Floats = middle + factor * (p - middle)
        return out

    def enlarged(part: PartData) -> PartData:
        groups = [Group(g.name, g.ids, np.float32(factor) * g.moves) for g in part.groups]
        return replace(part, points=moved(part.points), groups=groups)

    parts = [enlarged(p) for p in data.parts]
    shift = (1.0 - factor) * middle
    tilts = {
        n: np.column_stack([t[:, :3], factor * t[:, 3] - t[:, :3] @ shift])
        for n, t in ((n, np.asarray(t)) for n, t in data.jaw.tilts.items())
    }
    centre, glide = moved(np.array(data.jaw.centre)), factor * np.array(data.jaw.glide)
    lift = float(shift[1] + data.neck.slope * shift[2])
    px, py, pz = moved(np.array(data.neck.pivot)).tolist()
    neck = Neck((px, py, pz), data.neck.slope, factor * data.neck.still + lift, factor * data.neck.whole + lift)
    return replace(
        data, parts=parts, eyes=moved(data.eyes), eye_radius=factor * data.eye_radius, neck=neck,
        jaw=Jaw(tuple(centre.tolist()), data.jaw.angle_rad, tuple(glide.tolist()), tilts),
        contacts=[replace(c, reach_mm=factor * c.reach_mm) for c in data.contacts],
    )  # fmt: skip
