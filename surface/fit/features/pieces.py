"""Make the parts of a head: fitted skin, crowns, eyeballs, brows and lashes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.features.crowns import crown_chart, split_teeth
from surface.fit.features.hair import Skin, Strip, brow_strip, lash_strip
from surface.fit.features.rigging import lid_share, make_groups, tongue_groups
from surface.fit.points.eyeball import eyeball_surface
from surface.fit.points.recipe import PartRecipe
from surface.fit.points.refine import Fitted, fit_chart
from surface.fit.points.report import PartReport, measure
from surface.fit.points.strokes import mirrored, smooth_line, uv_of
from surface.fit.source.chart import TILE, Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw, PartData

LASH_ROOT = (0.0145, 0.0188)  # how far outside the hole in the skin lower and upper lashes begin, in v
LASH_MM, LOWER_LASH_MM = 8.0, 3.2
STRIP_BUDGET = {"brow": (0, 0.4, 6), "lash": (0, 0.2, 7)}  # fine enough for single hairs
LASHES, LOWER_LASHES = 24, 14
BROW_MM = (4.2, 4.6)  # how far a brow reaches below and above its line


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
        part.name, part.material, part.follows, fitted.points, np.ones(n),
        fitted.net.knots_u, fitted.net.knots_v, np.full((n, 2), 3), chart.loops, slits, part.budget, groups, share,
        lid_share(fitted.points, rig.eyes, rig.radius) if skin and rig.radius > 0 else np.zeros(n),
    )  # fmt: skip


def teeth_part(mesh: FitMesh, part: PartRecipe, rig: HeadRig) -> tuple[PartData, PartReport]:
    """One patch per tooth, all in one part."""
    first = mesh.faces[:, 0]
    low, high = part.vertices[0]
    teeth = split_teeth(mesh, np.flatnonzero((first >= low) & (first < high)))
    chart, crowns = crown_chart(mesh, teeth, part.follows != "jaw")
    request = replace(part.request, points=part.request.points * len(teeth), coarse=0.4, deepest=2, neutral_mm=0.08)
    fitted = fit_chart(crowns, chart, request)
    return skin_part(part, chart, fitted, rig), measure(part.name, chart, fitted, ())


def eyeball_part(side: str, centre: Floats, radius: float) -> PartData:
    """An exact sphere with a cornea; the pole is left out by a hair so that normals are defined everywhere."""
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
        rim = _rim_near(chart, mesh, eye)
        for upper in (True, False):
            root, along = _lid_line(rim, upper=upper, inner_first=is_left)
            length = (LASH_MM if upper else LOWER_LASH_MM) * _length_profile(along)
            lashes.append(lash_strip(skin, root, eye, length, upper=upper, hairs=LASHES if upper else LOWER_LASHES))
    return [_strips_part(n, m, s, rig) for n, m, s in (("brows", "brow", brows), ("lashes", "lash", lashes))]


def _brow_patch(chart: Chart, mesh: FitMesh, ids: Ints) -> Floats:
    """(m, k, 2) the skin under a brow in (u, v): along a smooth line through vertices, up and down from it."""
    line = smooth_line(mesh.vertices[ids], closed=False)
    along = np.linspace(0.0, 1.0, len(line))
    width = np.minimum(1.0, 0.75 + 1.2 * along) * np.minimum(1.0, (1.02 - along) * 2.2) ** 0.7
    heights = np.linspace(-BROW_MM[0], BROW_MM[1], 5)
    points = line[:, None, :] + (width[:, None] * heights)[..., None] * np.array([0.0, 1.0, 0.0])
    return uv_of(chart, mesh, points.reshape(-1, 3)).reshape(len(line), len(heights), 2)


def _length_profile(along: Floats) -> Floats:
    """Lashes are longest beyond the middle, short at the inner corner."""
    return 0.45 + 0.55 * np.sin(np.pi * np.clip(0.12 + 0.62 * along, 0, 1))


def _rim_near(chart: Chart, mesh: FitMesh, eye: Floats) -> Floats:
    """(k, 2) the hole of the face whose rim lies nearest to an eyeball."""
    middles = [np.linalg.norm(mesh.vertices[ids].mean(axis=0) - eye) for ids in chart.loop_vertices]
    return chart.loops[int(np.argmin(middles))]


def _lid_line(rim: Floats, *, upper: bool, inner_first: bool) -> tuple[Floats, Floats]:
    """(m, 2) the lashes' roots, just outside a lid's rim, inner corner first; (m,) 0..1 along the lid."""
    u0, u1 = rim[:, 0].min(), rim[:, 0].max()
    along = np.linspace(0.10, 0.95, 24) if upper else np.linspace(0.22, 0.94, 20)
    u = u0 + (u1 - u0) * (along if inner_first else 1.0 - along)
    middle = 0.5 * (rim[:, 1].min() + rim[:, 1].max())
    half = rim[(rim[:, 1] > middle) == upper]
    order = np.argsort(half[:, 0])
    v = np.interp(u, half[order, 0], half[order, 1])
    return np.column_stack([u, v + LASH_ROOT[upper] * (1.0 if upper else -1.0)]), along


def _strips_part(name: str, material: str, strips: list[Strip], rig: HeadRig) -> PartData:
    """Strips as one part, each in a tile of its own."""
    points = np.concatenate([s.points for s in strips])
    moves = np.concatenate([s.moves for s in strips], axis=1)
    groups, share = make_groups(points, moves, rig.sources, rig.jaw)
    knots_u = np.concatenate([s.surface.padded[0] + TILE * k for k, s in enumerate(strips)])
    knots_v = np.concatenate([s.surface.padded[1] for s in strips])
    degrees = np.concatenate([np.stack(s.surface.degrees, axis=1) for s in strips])
    loops = [loop + np.array([TILE * k, 0.0]) for k, s in enumerate(strips) for loop in s.loops]
    return PartData(
        name, material, "skin", points, np.ones(len(points)), knots_u, knots_v, degrees, loops, np.zeros((0, 3)),
        STRIP_BUDGET[material], groups, share, lid_share(points, rig.eyes, rig.radius),
    )  # fmt: skip
