"""Find the rims of the eyes' openings, by what can be seen of the eyeballs from the front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.check.raster import Picture, Shape, View
from surface.fit.eyes.names import is_eye
from surface.fit.source.kinds import kind_name
from surface.fit.source.mesh import FitMesh, triangles
from surface.head import Head
from surface.head.model.parameters import smoothstep

STEPS = 240  # pixels between the outer ends of both eyes
LEAST = 9  # pixels: an opening less wide or high than that has no rim
COLUMNS = 33  # of a rim
INSET = 0.02  # of an opening's width: how far from its ends the first and last column are
SIDES = ("left", "right")
NEAR, SOFT_MM = 4, 0.5  # places of a rim that a place beside it goes with; distance up to which they count alike
FADE = (0.1, 0.9)  # of an opening's width: distance from its rim at which a place goes with it fully, and not at all


@dataclass(frozen=True)
class Rims:
    """The rims of both openings.

    places : (2, 2, COLUMNS, 3) mm, left eye first, of each the upper and the lower lid, from inner to outer corner.
    """

    places: Floats

    def corners(self) -> dict[str, Floats]:
        """Places (3,) of the corners by the names of a transfer's landmarks. Its middles of lids are no rims that can
        be seen: they lie on the lids' inner edges."""
        out: dict[str, Floats] = {}
        for side, (upper, lower) in zip(SIDES, self.places, strict=True):
            out[f"{side}_eye_inner"], out[f"{side}_eye_outer"] = (0.5 * (upper[k] + lower[k]) for k in (0, -1))
        return out

    def moved_to(self, other: Rims, points: Floats) -> Floats:
        """Points (n, 3) near these rims, moved as these are to others; points far from them stay."""
        own, moves = self.places.reshape(-1, 3), (other.places - self.places).reshape(-1, 3)
        far, near = cKDTree(own).query(points, k=NEAR)
        width = float(np.linalg.norm(self.places[:, :, -1] - self.places[:, :, 0], axis=2).mean())
        fade = 1.0 - smoothstep(far[:, 0] / width, *FADE)
        weight = 1.0 / (far + SOFT_MM) ** 2
        weight *= (fade / weight.sum(axis=1))[:, None]
        moved: Floats = points + np.einsum("nk,nkc->nc", weight, moves[near])
        return moved


def rims_of_mesh(mesh: FitMesh) -> Rims | None:
    """The rims of a mesh in head axes; None where no piece is named as an eye, or the openings cannot be seen."""
    eyes = np.isin(mesh.piece, [k for k, name in enumerate(mesh.pieces) if is_eye(name)])
    skin = np.isin(mesh.piece, [k for k, name in enumerate(mesh.pieces) if kind_name(name) == "skin"])
    if not len(mesh.piece) or not eyes.any() or not skin.any():
        return None
    return find_rims([_shape(mesh, skin)], [_shape(mesh, eyes)])


def rims_of_head(head: Head) -> Rims | None:
    """The rims of a head at rest; None where its openings cannot be seen."""
    head.pose(head.values({}))
    skin = [(p.vertices.copy(), p.triangles) for p in head.parts if p.material == "skin"]
    eyes = [(p.vertices.copy(), p.triangles) for p in head.parts if p.material == "eye"]
    return find_rims(skin, eyes) if skin and eyes else None


def find_rims(skin: Sequence[Shape], eyes: Sequence[Shape]) -> Rims | None:
    """The rims between what is skin and what are eyes; None where either of the openings cannot be seen."""
    own = np.concatenate([at[np.unique(faces)] for at, faces in eyes]).astype(np.float64)
    low, high = own.min(axis=0), own.max(axis=0)
    step = float(high[0] - low[0]) / STEPS
    if not step > 0:
        return None
    picture = View((low[0], high[0]), (low[1] - step, high[1] + step), step).draw([*skin, *eyes])
    columns = picture.view.x[0] + step * np.arange(picture.parts.shape[1])
    middle, places = 0.5 * float(low[0] + high[0]), []
    for beyond in (columns > middle, columns < middle):
        seen = _largest((picture.parts >= len(skin)) & beyond[None])
        if min(seen.any(axis=0).sum(), seen.any(axis=1).sum()) < LEAST:
            return None
        places.append(_rim(picture, seen))
    return Rims(np.stack([places[0], places[1][:, ::-1]]))


def _shape(mesh: FitMesh, faces: Bools) -> Shape:
    return mesh.vertices.astype(np.float32), triangles(mesh.faces[faces]).astype(np.int32)


def _largest(seen: Bools) -> Bools:
    """The largest connected region of pixels (h, w)."""
    regions, count = label(seen)
    sizes: Ints = np.bincount(regions.ravel(), minlength=count + 1)
    sizes[0] = 0
    largest: Bools = (regions == sizes.argmax()) & seen
    return largest


def _rim(picture: Picture, seen: Bools) -> Floats:
    """(2, COLUMNS, 3) the skin right above and below the pixels (h, w) that are seen of one eye, by rising x."""
    columns = np.flatnonzero(seen.any(axis=0))
    upper = seen.shape[0] - 1 - seen[::-1, columns].argmax(axis=0)
    rows = np.stack([upper + 1, seen[:, columns].argmax(axis=0) - 1])
    x, y = picture.at(rows, np.stack([columns, columns]))
    depth = picture.depth[np.clip(rows, 0, len(seen) - 1), columns]
    eye = picture.depth[rows + np.array([[-1], [1]]), columns]
    z = np.where(np.isfinite(depth) & (np.abs(depth - eye) < np.ptp(x)), depth, eye)
    first, last = np.quantile(columns, [INSET, 1.0 - INSET])
    wanted = np.linspace(first, last, COLUMNS)
    return np.stack([
        np.column_stack([np.interp(wanted, columns, each) for each in lid]) for lid in zip(x, y, z, strict=True)
    ])  # fmt: skip
