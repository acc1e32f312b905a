"""Make the parts of a head: fitted skin, crowns, eyeballs, brows and lashes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_matrix

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.features.crowns import crown_chart, split_teeth
from surface.fit.features.rigging import lid_share, make_groups, tongue_groups
from surface.fit.features.tooth_rows import closed_row
from surface.fit.points.eyeball import eyeball_surface
from surface.fit.points.recipe import PartRecipe
from surface.fit.points.refine import Fitted, fit_chart
from surface.fit.points.report import PartReport, measure
from surface.fit.points.solve import basis
from surface.fit.points.strokes import mirrored, smooth_line, uv_of
from surface.fit.source.chart import TILE, Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw, PartData
from surface.head.posing.contact import LID_MM

DEGREES = (3, 2)
END_LASH = 0.045  # distance of the first and the last lash from the strip's ends
TIP = 0.0022  # half the width of a lash's tip, in the strip's length: a finer one would be cut into pieces
LASH_LEAN, LASH_LIFT = 0.85, 0.46  # of a lash's length: away from the eyeball, up along it
ROOT_MM = 0.4  # height above the skin of the lashes' roots: its triangles may be up to a quarter higher
LASH_ROOT = (0.0145, 0.0188)  # how far outside the hole in the skin lower and upper lashes begin, in v
LASH_MM, LOWER_LASH_MM = 8.0, 3.0
STRIP_BUDGET = {"brow": (0, 0.4, 6), "lash": (0, 0.6, 6)}  # fine enough for single hairs
LASHES, LOWER_LASHES = 30, 18  # along a lid: finer or more would be cut into pieces
LASH_LINES = {
    True: (0.02, 0.95, 27),
    False: (0.10, 0.94, 22),
}  # where upper and lower lashes grow along a lid, samples
INNER_LASH = 0.24, 0.8  # length of the innermost lash, of the longest; its width, of a lash's beyond the middle
BESIDE = 0.15  # in radii of an eyeball: so near to their own surface half the control points that keep to it have to be
BENT = 0.04  # in radii: more than this a strip that keeps to an eyeball may not lie beside a shape that was fitted
BROW_MM = (4.2, 4.6)  # how far a brow reaches below and above its line
UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Strip:
    """A fitted strip: control points (n, 3), displacements (k, n, 3), knots, comb loops."""

    points: Floats
    moves: Floats
    surface: DCPSurface
    loops: list[Floats]


class Skin:
    """The fitted face, neutral and in every shape, to root hair in."""

    def __init__(self, fitted: Fitted) -> None:
        self._net = fitted.net
        self._all = np.concatenate([fitted.points[None], fitted.points + fitted.moves])

    def at(self, uv: Floats) -> Floats:
        """(1 + k, m, 3) positions at places (m, 2) in (u, v), in neutral and in every shape."""
        b = basis(self._net, uv)
        return np.stack([b @ p for p in self._all])

    def normals(self, uv: Floats) -> Floats:
        """(1 + k, m, 3) unit normals, by differences."""
        step = 1e-4
        u, v = (self.at(uv + d) - self.at(uv - d) for d in (np.array([step, 0.0]), np.array([0.0, step])))
        n = np.cross(u, v)
        normals: Floats = n / np.maximum(np.linalg.norm(n, axis=2, keepdims=True), 1e-12)
        return normals


def fit_strip(rows: Floats, n_u: int, n_v: int, loops: list[Floats]) -> Strip:
    """A strip through sampled rows (1 + k, a, b, 3): a samples along, b across."""
    count, a, b, _ = rows.shape
    p, q = DEGREES
    empty = np.zeros((n_u, n_v, 3))
    net = DCPSurface.from_nurbs(p, q, _clamped(n_u, p), _clamped(n_v, q), empty, np.ones((n_u, n_v)))
    s, t = np.meshgrid(np.linspace(0, 1, a), np.linspace(0, 1, b), indexing="ij")
    matrix = net.basis_matrix(np.column_stack([s.ravel(), t.ravel()])).toarray()
    x = np.linalg.lstsq(matrix, rows.reshape(count, a * b, 3).transpose(1, 0, 2).reshape(a * b, -1), rcond=None)[0]
    x = x.reshape(n_u * n_v, count, 3).transpose(1, 0, 2)
    return Strip(x[0].copy(), x[1:] - x[:1], net, loops)


def _clamped(n: int, degree: int) -> Floats:
    return np.pad(np.linspace(0, 1, n - degree + 1), degree, mode="edge")


def lash_strip(skin: Skin, root: Floats, eye: Floats, length: Floats, *, upper: bool, hairs: int) -> Strip:
    """Lashes along a lid.

    root : (m, 2) (u, v) along the lid's edge; length : (m,) mm; eye : (3,) the eyeball's centre.
    """
    at = skin.at(root)
    away = at - eye
    away /= np.linalg.norm(away, axis=2, keepdims=True)
    up = np.array([0.0, 1.0 if upper else -1.0, 0.0]) - away * (away[..., 1:2] * (1.0 if upper else -1.0))
    up /= np.linalg.norm(up, axis=2, keepdims=True)
    reach = length[None, :, None]
    rows = [
        at + ROOT_MM * away,
        at + reach * (0.55 * LASH_LEAN * away + 0.12 * LASH_LIFT * up),
        at + reach * (LASH_LEAN * away + LASH_LIFT * up),
    ]
    return fit_strip(
        np.stack(rows, axis=2),
        10,
        3,
        [comb(hairs, lean=0.012, thick=0.36 if upper else 0.42, inner=INNER_LASH[1], seed=hairs)],
    )


def lash_length(along: Floats) -> Floats:
    """(m,) length of lashes along a lid (m,), 0 at the inner corner, of the longest, which grow beyond the middle."""
    inner = INNER_LASH[0]
    length: Floats = inner + (1.0 - inner) * np.sin(np.pi * np.clip(0.02 + 0.64 * along, 0.0, 1.0))
    return length


def comb(hairs: int, *, lean: float, thick: float, inner: float = 1.0, seed: int = 5) -> Floats:
    """One closed line: a thin continuous root, and hairs that taper to :data:`TIP`; ``thick`` in their distances, by
    ``inner`` of it at the line's beginning."""
    rng, root = np.random.default_rng(seed), 0.22 * thick
    tops = []
    for k in range(hairs):
        s = END_LASH + (1.0 - 2.0 * END_LASH) * (k + 0.5) / hairs  # the outermost lean outwards and must not be cut off
        half = thick / hairs * min(1.0, inner + 2.0 * (1.0 - inner) * s)
        tip = 1.0 - 0.35 * rng.random()
        shift = lean * (2 * s - 1) * 4 + 0.6 * (rng.random() - 0.5) / hairs
        tops += [(s - half, root), (s + shift - TIP, tip), (s + shift + TIP, tip), (s + half, root)]
    line = np.array([(0.0, 0.0), *tops, (1.0, 0.0)])
    return np.clip(line, 0.0, 1.0)  # type: ignore[no-any-return]


def brow_strip(skin: Skin, uv: Floats, *, hairs: int) -> Strip:
    """A brow over a patch of skin, ``uv (m, k, 2)``: m places along it from the inner end, k from its lower edge."""
    m, across, _ = uv.shape
    flat = uv.reshape(-1, 2)
    arch = (0.35 + 0.35 * np.sin(np.linspace(0, np.pi, across)))[None, None, :, None]
    rows = skin.at(flat).reshape(-1, m, across, 3) + arch * skin.normals(flat).reshape(-1, m, across, 3)
    return fit_strip(rows, 10, 4, [_ragged(hairs)])


def _ragged(hairs: int) -> Floats:
    """One closed line: hairs lean outwards over the upper edge, and start at uneven heights below."""
    rng = np.random.default_rng(3)
    s = (np.arange(hairs) + 0.5) / hairs
    top, bottom = [], []
    for x in s:
        reach, lean = 0.74 + 0.26 * rng.random(), (0.9 + 0.8 * rng.random()) / hairs
        top += [(x - 0.35 / hairs, 0.66 + 0.06 * rng.random()), (x + lean, reach)]
        bottom += [(x, 0.06 + 0.12 * rng.random()), (x + 0.5 / hairs, 0.2 + 0.08 * rng.random())]
    line = np.array([(0.0, 0.35), *top, (1.0, 0.5), *bottom[::-1]])
    return np.clip(line, 0.0, 1.0)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class HeadRig:
    """What all parts of one head share: shapes by parameter, the jaw's path, eyes, the path of the tongue (k, 7)."""

    sources: dict[str, list[int]]
    jaw: Jaw
    eyes: Floats
    radius: float
    tongue: Floats = field(default_factory=lambda: np.zeros((0, 7)))


def skin_part(part: PartRecipe, chart: Chart, fitted: Fitted, rig: HeadRig) -> PartData:
    """A fitted chart as a part; one that follows skull or jaw as a whole has no groups."""
    n, skin = len(fitted.net), part.follows == "skin"
    groups, share = make_groups(fitted.points, fitted.moves, rig.sources, rig.jaw) if skin else ([], np.zeros(n))
    if part.material == "tongue" and skin and len(rig.tongue):
        groups += tongue_groups(fitted.points, rig.tongue, rig.jaw)
    slits = np.array([[c.v, c.start, c.end] for c in chart.cuts]).reshape(-1, 3)
    return PartData(
        part.name, part.material, part.follows, fitted.points + part.raised * UP, np.ones(n),
        fitted.net.knots_u, fitted.net.knots_v, np.full((n, 2), 3), chart.loops, slits, part.budget, groups, share,
        _lid_share(part, fitted, rig) if skin and rig.radius > 0 else np.zeros(n),
    )  # fmt: skip


def _lid_share(part: PartRecipe, fitted: Fitted, rig: HeadRig) -> Floats:
    """How closely control points (n,) keep to the eyeballs, as lids do.

    The net of a narrow strip, as of lashes, may have its control points far beside it: their own distance from an
    eyeball says nothing of the strip's, and kept alike it would bend the strip in every blink. None of it keeps then.
    """
    share = lid_share(fitted.points, rig.eyes, rig.radius)
    held = np.flatnonzero(share)
    if part.material == "skin" or not len(held):
        return share
    at = basis(fitted.net, fitted.net.centres)
    away = np.linalg.norm(at @ fitted.points - fitted.points, axis=1)
    keeps = np.median(away[held]) < BESIDE * rig.radius and _bent(fitted, at, share, rig) < BENT * rig.radius
    return share if keeps else np.zeros(len(share))


def _bent(fitted: Fitted, at: csr_matrix, share: Floats, rig: HeadRig) -> float:
    """How far, mm, a strip lies beside its own shapes where control points that a shape takes into the eyeball are kept
    out of it, as :class:`.rig.Lids` does. at : rows of the strip's places."""
    held = np.flatnonzero(share)
    local = fitted.points[held] - rig.eyes[(share[held] < 0).astype(int)]
    least = np.minimum(np.linalg.norm(local, axis=1), rig.radius + LID_MM)
    most = 0.0
    for indices in rig.sources.values():
        moved = local + fitted.moves[indices].sum(axis=0)[held]
        length = np.maximum(np.linalg.norm(moved, axis=1), 1e-6)
        kept = (np.abs(share[held]) * (np.maximum(length, least) / length - 1.0))[:, None] * moved
        most = max(most, float(np.linalg.norm(at[:, held] @ kept, axis=1).max(initial=0.0)))
    return most


def teeth_part(mesh: FitMesh, part: PartRecipe, rig: HeadRig) -> tuple[PartData, PartReport]:
    """One patch per tooth, all in one part; neighbours touch, which those of the mesh need not. The report is of how
    the patches follow the mesh, before that."""
    first = mesh.faces[:, 0]
    low, high = part.vertices[0]
    teeth = split_teeth(mesh, np.flatnonzero((first >= low) & (first < high)))
    chart, crowns = crown_chart(mesh, teeth, part.follows != "jaw")
    request = replace(part.request, points=part.request.points * len(teeth), coarse=0.4, deepest=2, neutral_mm=0.08)
    fitted = fit_chart(crowns, chart, request)
    data, upper = skin_part(part, chart, fitted, rig), part.follows != "jaw"
    return replace(data, points=closed_row(data, upper=upper)), measure(part.name, chart, fitted, ())


def eyeball_part(side: str, centre: Floats, radius: float) -> PartData:
    """An exact sphere with a cornea; a tiny hole at the pole is left out so that normals are defined everywhere."""
    s = eyeball_surface(centre, radius)
    none = np.zeros(s.n)
    loop = np.array([[0.0, 1e-3], [1.0, 1e-3], [1.0, 1.0], [0.0, 1.0]])
    ku, kv = s.padded
    return PartData(
        f"eye_{side}", "eye", f"{side}_eye", s.points.copy(), s.weights.copy(), ku.copy(), kv.copy(),
        np.stack(s.degrees, axis=1), [loop], np.zeros((0, 3)), (0, 0.01 * radius, 6), [], none, none,
    )  # fmt: skip


def hair_parts(mesh: FitMesh, chart: Chart, fitted: Fitted, brow: list[int], rig: HeadRig) -> list[PartData]:
    """Brows and lashes of both sides, rooted in the fitted face."""
    skin = Skin(fitted)
    left = np.array(brow)
    brows, lashes = [], []
    for ids, eye, is_left in zip((left, mirrored(chart, mesh, left)), rig.eyes, (True, False), strict=True):
        brows.append(brow_strip(skin, _brow_patch(chart, mesh, ids), hairs=40))
        rim = chart.loops[chart.hole_near(mesh.vertices, eye)]
        for upper in (True, False):
            root, along = _lid_line(rim, upper=upper, inner_first=is_left)
            length = (LASH_MM if upper else LOWER_LASH_MM) * lash_length(along)
            hairs = LASHES if upper else LOWER_LASHES
            lashes.append(lash_strip(skin, root, eye, length, upper=upper, hairs=hairs))
    return [strips_part(n, m, s, rig) for n, m, s in (("brows", "brow", brows), ("lashes", "lash", lashes))]


def _brow_patch(chart: Chart, mesh: FitMesh, ids: Ints) -> Floats:
    """(m, k, 2) the skin under a brow in (u, v): along a smooth line through vertices, up and down from it."""
    line = smooth_line(mesh.vertices[ids], closed=False)
    along = np.linspace(0.0, 1.0, len(line))
    width = np.minimum(1.0, 0.75 + 1.2 * along) * np.minimum(1.0, (1.02 - along) * 2.2) ** 0.7
    heights = np.linspace(-BROW_MM[0], BROW_MM[1], 5)
    points = line[:, None, :] + (width[:, None] * heights)[..., None] * np.array([0.0, 1.0, 0.0])
    return uv_of(chart, mesh, points.reshape(-1, 3)).reshape(len(line), len(heights), 2)


def _lid_line(rim: Floats, *, upper: bool, inner_first: bool) -> tuple[Floats, Floats]:
    """(m, 2) the lashes' roots, just outside a lid's rim, inner corner first; (m,) 0..1 along the lid."""
    u0, u1 = rim[:, 0].min(), rim[:, 0].max()
    along = np.linspace(*LASH_LINES[upper][:2], LASH_LINES[upper][2])
    u = u0 + (u1 - u0) * (along if inner_first else 1.0 - along)
    middle = 0.5 * (rim[:, 1].min() + rim[:, 1].max())
    half = rim[(rim[:, 1] > middle) == upper]
    order = np.argsort(half[:, 0])
    v = np.interp(u, half[order, 0], half[order, 1])
    return np.column_stack([u, v + LASH_ROOT[upper] * (1.0 if upper else -1.0)]), along


def strips_part(
    name: str, material: str, strips: list[Strip], rig: HeadRig, budget: tuple[int, float, int] | None = None
) -> PartData:
    """Strips as one part, each in its own tile."""
    points = np.concatenate([s.points for s in strips])
    moves = np.concatenate([s.moves for s in strips], axis=1)
    groups, share = make_groups(points, moves, rig.sources, rig.jaw)
    knots_u = np.concatenate([s.surface.padded[0] + TILE * k for k, s in enumerate(strips)])
    knots_v = np.concatenate([s.surface.padded[1] for s in strips])
    degrees = np.concatenate([np.stack(s.surface.degrees, axis=1) for s in strips])
    loops = [loop + np.array([TILE * k, 0.0]) for k, s in enumerate(strips) for loop in s.loops]
    return PartData(
        name, material, "skin", points, np.ones(len(points)), knots_u, knots_v, degrees, loops, np.zeros((0, 3)),
        budget or STRIP_BUDGET[material], groups, share, lid_share(points, rig.eyes, rig.radius),
    )  # fmt: skip
