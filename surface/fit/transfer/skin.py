"""Bring a head's skin onto a scan: by the map, then by the scan's own detail, with closed lips and seated lids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.features.rigging import lid_share
from surface.fit.transfer.detail.below_neck import neck_share
from surface.fit.transfer.detail.cover import Sheet, cover
from surface.fit.transfer.detail.finer_mesh import finer_mesh
from surface.fit.transfer.detail.finer_points import fit_points
from surface.fit.transfer.detail.rounded import looseness, weights
from surface.fit.transfer.detail.uncross import uncrossed
from surface.fit.transfer.place_parts import fit_scale_shift
from surface.fit.transfer.register import Matcher
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.warp import Warp
from surface.head import Contact, Head, HeadPart, Jaw, PartData
from surface.head.model.data import Neck
from surface.head.model.parameters import smoothstep

DETAIL_MM, PASSES = 5.0, 3  # greatest distance of the scan's detail that one pass follows; number of passes
SMOOTH = 0.6  # weight of smoothness, relative to that of the detail
FOLDED = 0.3  # least cosine between a triangle's normal before and after following detail; below it is a fold
UNFOLDINGS, STILL = 4, 0.1  # attempts of a pass to remove folds; weight that keeps skin at folds where the map puts it
RIM_MM = (1.5, 4.0)  # distance from the rim of an opening where detail of the scan begins to count, and counts fully
CLOSINGS = 12  # iterations, because each one leaves a share of the gap
LOOSE, HELD = 3e-4, 1e4  # weights of where skin is, and of where borders are pulled to, relative to SMOOTH's
SEAM, SEAM_MM = 20.0, 8.0  # weight of seams in the least squares of control points, as their sides are fitted by
# themselves; distance at which it has faded out
ON_MM = (1.5, 0.5)  # distance from the nearest sample, and from its tangent plane, of skin that lies on the scan
FREE_MM = 6.0  # least distance from the rims of openings of skin that goes where the scan lacks it
FRONT_MM = 6.0  # distance from what the scan shows of the face's front, within which skin stays though it crosses
LIP_FADE_MM = (3.0, 16.0)  # distance from the line of the lips up to which skin moves with them, and where it is still
NEAR, NEAR_MM = 6, 12.0  # nearest points of the skin that another part follows, and distance at which it no longer does


@dataclass(frozen=True)
class Ball:
    """Both eyeballs: centres (2, 3), left first, and radius, mm."""

    centres: Floats
    radius: float


class Skin:
    """One part of skin as triangles: ``rest (n, 3)`` on the head it comes from, ``at (n, 3)`` on the scan.

    points : (k, 3) control points of its surface, set by :meth:`solve`. rims : (r, 3) rims of all openings. eyes : the
    eyeballs of the head it comes from. longest : of the triangles' edges, mm; the head's own are split.
    """

    def __init__(self, part: HeadPart, rims: Floats, warp: Warp, eyes: Ball, longest: float = np.inf) -> None:
        self.name, self.surface = part.name, part.surface
        own = part.vertices[: len(part.mesh.uv)].astype(float)  # seams may have added copies
        self.mesh = finer_mesh(part.mesh, own, part.surface, warp, longest)
        self.rest, n = self.mesh.rest, len(self.mesh.uv)
        self.at = warp(self.rest)
        distance = cKDTree(rims).query(self.rest)[0] if len(rims) else np.full(n, np.inf)
        self.points = part.surface.points.copy()
        # lids keep their own form, because those of a scan are joined to its eyes, or lie inside an eyeball
        lids = np.abs(lid_share(self.rest, eyes.centres, eyes.radius))
        self._seen = smoothstep(distance, *RIM_MM) * (1.0 - lids)
        self._free = (distance > FREE_MM) & (lids == 0.0)
        self._weight = np.ones(n)  # in least squares
        self._on = np.zeros(n, bool)  # the scan
        self._steps = _steps(self.mesh.triangles, n)
        self._matrix = (self._steps.T @ self._steps).tocsr()

    def follow(self, matcher: Matcher, scale: float) -> None:
        """Move the skin along its normals to the scan where the scan has data, and interpolate smoothly elsewhere.

        Skin that would fold, as under hair that hides an ear, is interpolated, too. scale : size of the new head,
        relative to the one the skin comes from.
        """
        mapped = self._facing(self.at)
        folds = np.zeros(len(self.at), bool)
        for _ in range(PASSES):
            normals = self.normals()
            match = matcher.find(self.at, normals, DETAIL_MM * scale, 0.0)
            off = ((match.goals - self.at) * normals).sum(axis=1)
            for _ in range(UNFOLDINGS):
                weight = np.where(folds, STILL, self._seen * match.found)
                system = (diags(weight + 1e-6) + SMOOTH * self._matrix).tocsc()
                at = self.at + _solved(system, weight * np.where(folds, 0.0, off))[:, None] * normals
                if not (more := self._folded(at, mapped) & ~folds).any():
                    break
                folds |= more
            self.at, self._on = at, match.found

    def round_off(self, samples: Samples, neck: Neck, scale: float) -> None:
        """Make the skin round about where it leaves the scan for good, but not on the front of the face, at
        openings or on the neck.

        There it bends as on the head that it comes from. samples : of the scan's front. neck : of that head. scale : as
        for :meth:`follow`.
        """
        able = (1.0 - neck_share(self.rest, neck)) * self._free
        loose = looseness(self.at, self._on, able, samples.points, scale)
        if loose.any():
            base = fit_scale_shift(self.rest[self._on], self.at[self._on]).points(self.rest)
            weight, off = weights(loose)[:, None], self.at - base
            self.at = base + _solved((diags(weight[:, 0]) + SMOOTH * self._matrix).tocsc(), weight * off)

    def cover(self, matcher: Matcher, samples: Samples, scale: float) -> None:
        """Move the skin to those samples of the scan that none of it is near, such as pits and closed nostrils, outside
        openings and lids. scale : size of the new head, relative to the one the skin comes from."""
        match = matcher.find(self.at, self.normals(), ON_MM[0] * scale, 0.0)
        on = match.found & (np.linalg.norm(match.goals - self.at, axis=1) < ON_MM[1] * scale)
        sheet = Sheet(self.mesh.triangles, self._steps, self._free)
        self.at = cover(sheet, self.at, ~on, samples.points, samples.normals)

    def may_go_back(self, samples: Samples, scale: float) -> Bools:
        """(n,) which vertices may go back to where a stiffer map puts them: not those at the samples of the scan's
        front, nor those at the rims of openings."""
        tree = cKDTree(samples.points) if len(samples.points) else None
        beside = np.ones(len(self.at), bool) if tree is None else tree.query(self.at)[0] > FRONT_MM * scale
        out: Bools = beside & self._free
        return out

    def pull(self, ids: Ints, places: Floats) -> None:
        """Move vertices ``ids (k,)`` to ``places (k, 3)``, and the skin around them smoothly with them."""
        if not len(ids):
            return
        weight = np.full(len(self.at), LOOSE)
        weight[ids] = HELD
        goal = np.zeros_like(self.at)
        goal[ids] = places - self.at[ids]
        system = (diags(weight) + SMOOTH * self._matrix).tocsc()
        self.at = self.at + _solved(system, weight[:, None] * goal)
        far = cKDTree(places).query(self.at)[0]
        self._weight = 1.0 + (SEAM - 1.0) * (1.0 - smoothstep(far, 0.0, SEAM_MM))

    def _facing(self, at: Floats) -> Floats:
        """(t, 3) unit normals of the skin's triangles over vertices (n, 3)."""
        a, b, c = (at[self.mesh.triangles[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        unit: Floats = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-12)[:, None]
        return unit

    def _folded(self, at: Floats, mapped: Floats) -> Bools:
        """(n,) which vertices (n, 3) belong to folded triangles or are neighbours of one.

        mapped : (t, 3) normals of the triangles as the map puts them.
        """
        tri = self.mesh.triangles
        folded = np.zeros(len(at), bool)
        folded[tri[(self._facing(at) * mapped).sum(axis=1) < FOLDED]] = True
        out = folded.copy()
        out[tri[folded[tri].any(axis=1)]] = True
        return out

    def normals(self) -> Floats:
        """(n, 3) unit normals of the skin's vertices."""
        tri = self.mesh.triangles
        cross = np.cross(self.at[tri[:, 1]] - self.at[tri[:, 0]], self.at[tri[:, 2]] - self.at[tri[:, 0]])
        out = np.zeros_like(self.at)
        for k in range(3):
            np.add.at(out, tri[:, k], cross)
        unit: Floats = out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
        return unit

    def solve(self, part: PartData, jaw: Jaw) -> PartData:
        """Fit the control points to the skin in least squares, and move the skin to the fitted surface.

        part, jaw : the skin, and the path of the jaw, of the head that they come from. Returns the part with more
        control points where they were too far apart; it has its form and expressions as before.
        """
        fitted = fit_points(part, self.mesh, self.at, self._seen, jaw, self._weight)
        self.surface, self.points, self.at = fitted.surface, fitted.points, fitted.at
        return fitted.part


def uncross(skins: Sequence[Skin], smooth: Warp, samples: Samples, scale: float) -> None:
    """Move skin that passes through itself to where a stiffer map puts it: an ear's front and its back are skins of
    their own. Arguments are as those of :meth:`Skin.may_go_back`, ``smooth`` the stiffer map."""
    first = np.cumsum([0, *(len(s.at) for s in skins)])
    at, rest = (np.concatenate(rows) for rows in ([s.at for s in skins], [s.rest for s in skins]))
    triangles = np.concatenate([s.mesh.triangles + n for s, n in zip(skins, first, strict=False)])
    part = np.repeat(np.arange(len(skins)), [len(s.mesh.triangles) for s in skins])
    able = np.concatenate([s.may_go_back(samples, scale) for s in skins])
    out = uncrossed(at, smooth(rest), rest, triangles, part, able)
    for skin, low, high in zip(skins, first, first[1:], strict=False):
        skin.at = out[low:high]


def _solved(system: csc_matrix, right: Floats) -> Floats:
    """x (n,) with system @ x = right; the system (n, n) is symmetric and positive, which saves most of the time."""
    factors = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    x: Floats = factors.solve(right)
    return x


def _steps(triangles: Ints, n: int) -> csr_matrix:
    """(n, n) steps to each of the corners of triangles from the mean of its neighbours; its square is the squared graph
    Laplacian, normalised."""
    a = np.concatenate([triangles, triangles[:, ::-1]]).reshape(-1, 3)
    i, j = np.concatenate([a[:, 0], a[:, 1], a[:, 2]]), np.concatenate([a[:, 1], a[:, 2], a[:, 0]])
    links = coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    links.data[:] = 1.0
    share = diags(1.0 / np.maximum(np.asarray(links.sum(axis=1)).ravel(), 1.0)) @ links
    return (diags(np.ones(n)) - share).tocsr()


def close_lips(skin: Skin, contact: Contact, scale: float) -> None:
    """Close the lips as far as they are closed on the head that the skin comes from; those of the scan may be parted.

    In every column of the contact the lowest sample of the upper lip and the highest of the lower lip are brought
    together. scale : size of the new head, relative to the old one.
    """
    rows = contact.places.shape[2] * 2 // 3
    places, surface = contact.places[:, :, :rows], skin.surface
    share = surface.basis_matrix(places.reshape(-1, 2))
    lines, gap = _lip_lines((share @ surface.points).reshape(*places.shape[:3], 3))
    order = np.argsort(lines[0, :, 0])
    up, before = _lip_share(surface, contact, lines), skin.points.copy()
    amount = np.zeros(len(order))
    for _ in range(CLOSINGS):
        apart = _lip_lines((share @ skin.points).reshape(*places.shape[:3], 3))[1] - scale * gap
        amount = np.maximum(amount + apart, 0.0)
        push = np.interp(surface.points[:, 0], lines[0, order, 0], amount[order])
        skin.points[:, 1] = before[:, 1] + up * push
    b = surface.basis_matrix(skin.mesh.uv, side=skin.mesh.side)
    skin.at = skin.at + b @ (skin.points - before)


def _lip_share(surface: DCPSurface, contact: Contact, lines: Floats) -> Floats:
    """(n,) how far up each control point moves for each millimetre between the lips, whose lines are (2, k, 3)."""
    uv = np.column_stack([k[:, 1:4].mean(axis=1) for k in surface.padded])  # in space the lips touch
    side = np.stack([cKDTree(own.reshape(-1, 2)).query(uv)[0] for own in contact.places]).argmin(axis=0)
    distance = np.stack([cKDTree(line).query(surface.points)[0] for line in lines])
    fade = 1.0 - smoothstep(distance[side, np.arange(len(uv))], *LIP_FADE_MM)
    out: Floats = np.where(side == 0, -contact.share, 1.0 - contact.share) * fade
    return out


def _lip_lines(at: Floats) -> tuple[Floats, Floats]:
    """For samples (2, k, m, 3) of both lips in k columns: (2, k, 3) those nearest to the other lip in every column, and
    (k,) the height between them."""
    upper, lower = at
    k = np.arange(len(upper))
    lines = np.stack([upper[k, upper[..., 1].argmin(axis=1)], lower[k, lower[..., 1].argmax(axis=1)]])
    gap: Floats = lines[0, :, 1] - lines[1, :, 1]
    return lines, gap


def seat_on_eyeballs(points: Floats, rest: Floats, old: Ball, new: Ball) -> Floats:
    """Points (n, 3) of lids, moved along the radius of the new eyeballs until they are as high above these as ``rest
    (n, 3)`` is above the old ones, in proportion. Points that are not near an eyeball stay."""
    share = lid_share(rest, old.centres, old.radius)
    side = (share < 0).astype(int)
    ratio = new.radius / old.radius
    above = ratio * (np.linalg.norm(rest - old.centres[side], axis=1) - old.radius)
    offset = points - new.centres[side]
    length = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
    move = np.abs(share) * (new.radius + above - length)
    seated: Floats = points + (move / length)[:, None] * offset
    return seated


def _followed(points: Floats, rest: Floats, moves: Floats) -> Floats:
    """(m, 3) weighted means of the moves (n, 3) of the points ``rest (n, 3)`` nearest to each of ``points (m, 3)``."""
    distance, near = cKDTree(rest).query(points, k=NEAR)
    weight = 1.0 / (distance + 0.3) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    mean: Floats = np.einsum("mk,mkc->mc", weight, moves[near])
    return mean


def follow_skin(points: Floats, skin: Skin, warp: Warp) -> Floats:
    """Points (m, 3) of another part, moved by the map and, near the skin, also by how far the skin left the map."""
    residual = skin.at - warp(skin.rest)
    nearest = cKDTree(skin.rest).query(points)[0]
    fade = 1.0 - smoothstep(nearest, 0.0, NEAR_MM)
    moved: Floats = warp(points) + fade[:, None] * _followed(points, skin.rest, residual)
    return moved


def behind_lids(points: Floats, skin: Skin, old: Ball, new: Ball) -> Floats:
    """Points (n, 3) of the sockets behind the lids, moved with the eyeballs and, along their surface, with the skin.

    Their height above the eyeballs keeps its proportion, so that they stay behind the lids.
    """

    def with_eyeball(at: Floats) -> Floats:
        side = (at[:, 0] < old.centres[:, 0].mean()).astype(int)
        on: Floats = new.centres[side] + new.radius / old.radius * (at - old.centres[side])
        return on

    fade = 1.0 - smoothstep(cKDTree(skin.rest).query(points)[0], 0.0, NEAR_MM)
    on = with_eyeball(points)
    moved = on + fade[:, None] * _followed(points, skin.rest, skin.at - with_eyeball(skin.rest))
    centre = new.centres[(points[:, 0] < old.centres[:, 0].mean()).astype(int)]
    offset, height = moved - centre, np.linalg.norm(on - centre, axis=1)
    laid: Floats = centre + offset * (height / np.maximum(np.linalg.norm(offset, axis=1), 1e-9))[:, None]
    return laid


def rims_of(head: Head) -> Floats:
    """(m, 3) points of the rims of all openings of a head's face."""
    lips = [c for c in head.data.contacts if c.name == "lips"]
    part = next(p for p in head.data.parts if p.name == lips[0].part)
    surface: DCPSurface = head.part(part.name).surface
    rims: Floats = surface.evaluate(np.concatenate(part.loops[1:]))
    return rims
