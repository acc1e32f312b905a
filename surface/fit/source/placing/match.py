"""Find a face by its form alone, in a mesh of any unit, axes and origin: scans and sculptures without shapes.

The planes in which the mesh mirrors itself leave one angle, one place along the profile and a size unknown. From every
point of the profile that stands out, as a nose does, the front of an average face is brought nearer by the method of
iterated closest points (Besl and McKay, 1992), scaled after Umeyama (1991); the best fit must be good and clearly
better than any other way round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.base.files import read_npz
from surface.fit.source.mesh import triangles
from surface.fit.source.placing.symmetry import Mirror, find_mirrors

TEMPLATE = Path(__file__).with_name("face_template.npz")  # the front of the shipped head, mm, 400 points and normals
NOSE = np.array([0.0, 0.0, 130.5])  # its tip
TEMPLATE_HEIGHT = 180.0  # mm
COARSE, SAMPLES = 120, 8000  # points of the template and of the mesh in the first search
REFINED_SAMPLES = 3000  # points of the mesh in the refinement
FACE_FRACTIONS = (
    1.1,
    0.8,
    0.55,
    0.38,
    0.26,
    0.13,
    0.1,
)  # of the mesh's height that the face may take: mask, head, bust, body
ANGLES = 12  # directions that are tried as up
NOSES = 6  # places in one profile that are tried as the nose
BINS = 60  # heights of a profile
NEIGHBOUR_BINS = 4  # heights above and below a place that it must stand out of
MAX_REFINED = 24  # fits that are refined
STEPS = 40  # of a refinement: after 15 some slide on by millimetres along the face
MAX_ALIGNMENT = 0.8  # mean of the normals of a sheet: above this it is too flat for a face; masks have up to 0.65
MAX_DISTANCE = 25.0  # mm of the template: larger distances count as this
GOOD_MM = 6.5  # the mean error of a face: sculptures and simple faces have up to 6, no other place less than 7
MIN_LEAD = 1.25  # factor by which any other orientation must fit worse
SAME_TRACE = 2.6  # trace of the rotation between two orientations above which they are the same (37 degrees)


@dataclass(frozen=True)
class FaceMatch:
    """A face found: template coordinates (mm) go to ``scale * point @ turn + shift``; rows of ``turn`` (3, 3) are left,
    up and forward in the file. error : in mm of the template, mean of distances and turned normals."""

    turn: Floats
    scale: float
    shift: Floats
    error: float

    def at(self, places: Floats) -> Floats:
        """Places (..., 3) of the shipped head, mm, in the file."""
        out: Floats = self.scale * (places @ self.turn) + self.shift
        return out


def match_face(vertices: Floats, faces: Ints) -> FaceMatch | None:
    """The face in a mesh, vertices (n, 3) and faces (f, 4); None where no place is clearly one."""
    if len(faces) < 100 or _flatness(vertices, faces) > MAX_ALIGNMENT:
        return None
    points, normals = _sampled(vertices, faces)
    starts = [s for mirror in find_mirrors(points[:REFINED_SAMPLES]) for s in _starts(points, mirror)]
    if not starts:
        return None
    template, facing = _template()
    rough = _Cloud(points[:REFINED_SAMPLES], normals[:REFINED_SAMPLES]).fits(
        template[:COARSE], facing[:COARSE], starts, 4
    )
    cloud = _Cloud(points, normals)
    found = sorted(cloud.fits(template, facing, rough[:MAX_REFINED], STEPS), key=lambda m: m.error)
    if not found or found[0].error > GOOD_MM:
        return None
    others = [m for m in found[1:] if float((m.turn * found[0].turn).sum()) < SAME_TRACE]
    return found[0] if not others or others[0].error > MIN_LEAD * found[0].error else None


@cache
def _template() -> tuple[Floats, Floats]:
    """Points and unit normals (400, 3) of the average face, spread evenly: any number of the first are spread, too."""
    arrays = read_npz(TEMPLATE)
    return arrays["points"].astype(float), arrays["normals"].astype(float)


def _flatness(vertices: Floats, faces: Ints) -> float:
    """Length of the sum of all faces' normals times areas, relative to their area: 1 of a plane, 0 of a closed mesh."""
    corner = vertices[triangles(faces)]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return float(np.linalg.norm(cross.sum(axis=0)) / max(float(np.linalg.norm(cross, axis=1).sum()), 1e-30))


def _sampled(vertices: Floats, faces: Ints) -> tuple[Floats, Floats]:
    """Random points on the mesh and normals there, half of them where it is meshed finely, as faces are."""
    tri = triangles(faces)
    corner = vertices[tri]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(cross, axis=1)
    rng = np.random.default_rng(0)  # a mesh is always found in the same way
    share = 0.5 * area / max(float(area.sum()), 1e-30) + 0.5 / len(tri)
    chosen = rng.choice(len(tri), SAMPLES, p=share / share.sum())
    a, b = np.sqrt(rng.random((SAMPLES, 1))), rng.random((SAMPLES, 1))
    weights = np.hstack([1.0 - a, a * (1.0 - b), a * b])
    points = np.einsum("nk,nkx->nx", weights, corner[chosen])
    return points, cross[chosen] / np.maximum(area[chosen], 1e-30)[:, None]


def _starts(points: Floats, mirror: Mirror) -> list[FaceMatch]:
    """The template with its nose at every place that stands out of the profile, in every direction and size."""
    spare = np.eye(3) - np.outer(mirror.normal, mirror.normal)
    first = spare[np.argmax(np.linalg.norm(spare, axis=1))]
    first = first / np.linalg.norm(first)
    second = np.cross(mirror.normal, first)
    out = []
    for angle in np.arange(ANGLES) * (2.0 * np.pi / ANGLES):
        up = np.cos(angle) * first + np.sin(angle) * second
        for left in (mirror.normal, -mirror.normal):
            turn = np.stack([left, up, np.cross(left, up)])
            local = (points - mirror.centre) @ turn.T
            height = float(np.ptp(local[:, 1]))
            for nose in _noses(local, height):
                for share in FACE_FRACTIONS:
                    scale = share * height / TEMPLATE_HEIGHT
                    shift = mirror.centre + (np.array([0.0, *nose]) - scale * NOSE) @ turn
                    out.append(FaceMatch(turn, scale, shift, np.inf))
    return out


def _noses(local: Floats, height: float) -> list[tuple[float, float]]:
    """Height and depth of the places that stand out of the profile of points (n, 3) in head axes, those that stand out
    most first."""
    profile = local[np.abs(local[:, 0]) < 0.03 * height]
    if len(profile) < BINS // 2:
        return []
    low = float(local[:, 1].min())
    level = np.clip(((profile[:, 1] - low) / height * BINS).astype(int), 0, BINS - 1)
    depth = np.full(BINS, -np.inf)
    np.maximum.at(depth, level, profile[:, 2])
    padded = np.pad(depth, NEIGHBOUR_BINS, constant_values=-np.inf)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOUR_BINS + 1)
    peaks = np.flatnonzero(
        np.isfinite(depth) & (depth >= around[:, NEIGHBOUR_BINS - 2 : NEIGHBOUR_BINS + 3].max(axis=1))
    )
    lowest = np.where(np.isfinite(around), around, np.inf).min(axis=1)  # what is beside a nose lies further back
    peaks = peaks[np.argsort(lowest[peaks] - depth[peaks], kind="stable")][:NOSES]
    return [(low + (k + 0.5) / BINS * height, float(depth[k])) for k in peaks.tolist()]


class _Cloud:
    """Points of a mesh, with normals, that a template is brought near to."""

    def __init__(self, points: Floats, normals: Floats) -> None:
        self.points, self.normals, self._tree = points, normals, cKDTree(points)

    def fits(self, template: Floats, facing: Floats, starts: list[FaceMatch], steps: int) -> list[FaceMatch]:
        """Every start, refined; the best first. All are moved together, (k, n, 3) points at a time."""
        turn, shift = np.stack([s.turn for s in starts]), np.stack([s.shift for s in starts])
        scale = np.array([s.scale for s in starts])
        for _ in range(steps):
            distance, agree, target = self._nearest(template, facing, turn, scale, shift)
            limit = np.quantile(distance, 0.85, axis=1)
            weight = ((agree > 0.1) & (distance <= limit[:, None])).astype(float) + 1e-9
            turn, scale, shift = _moved(template, target, weight / weight.sum(axis=1)[:, None], turn, scale)
        distance, agree, _ = self._nearest(template, facing, turn, scale, shift)
        off = np.minimum(distance / scale[:, None], MAX_DISTANCE).mean(axis=1)
        error = off + 10.0 * (1.0 - np.clip(agree, 0.0, 1.0)).mean(axis=1)
        order = np.argsort(error, kind="stable")
        return [FaceMatch(turn[k], float(scale[k]), shift[k], float(error[k])) for k in order]

    def _nearest(
        self, template: Floats, facing: Floats, turn: Floats, scale: Floats, shift: Floats
    ) -> tuple[Floats, Floats, Floats]:  # fmt: skip
        """Distance and agreement of normals (k, n) to the nearest points of the mesh, and these (k, n, 3)."""
        placed = scale[:, None, None] * np.einsum("ni,kij->knj", template, turn) + shift[:, None]
        distance, index = self._tree.query(placed.reshape(-1, 3))
        index = index.reshape(placed.shape[:2])
        agree = np.einsum("ni,kij,knj->kn", facing, turn, self.normals[index])
        return distance.reshape(placed.shape[:2]), agree, self.points[index]


def _moved(
    template: Floats, target: Floats, weight: Floats, turn: Floats, scale: Floats
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Rotations about each one's left, scales and shifts in its mirror plane that bring the template nearer."""
    local = np.einsum("knj,kij->kni", target, turn)  # in the present head axes: left, up, forward
    middle_t, middle = np.einsum("kn,ni->ki", weight, template), np.einsum("kn,kni->ki", weight, local)
    a, b = template[None] - middle_t[:, None], local - middle[:, None]
    along = (weight * (a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])).sum(axis=1)
    across = (weight * (a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1])).sum(axis=1)
    angle = np.arctan2(across, along)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    up, forward = turn[:, 1], turn[:, 2]
    new = np.stack([turn[:, 0], cos * up + sin * forward, cos * forward - sin * up], axis=1)
    sideways = (weight * a[..., 0] * b[..., 0]).sum(axis=1)
    spread = (weight[..., None] * a**2).sum(axis=(1, 2))
    wanted = (sideways + np.hypot(along, across)) / np.maximum(spread, 1e-12)
    scale = scale * np.clip(wanted / scale, 0.85, 1.18)
    # the mirror plane stays: the template's own is x = 0 in it, whatever the pairs say
    middle_file = np.einsum("ki,kij->kj", middle, turn)
    shift = middle_file - scale[:, None] * np.einsum("ki,kij->kj", middle_t, new)
    return new, scale, shift
