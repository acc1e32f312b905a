"""Beards: thin shells over cheeks, jaw and chin, and over the upper lip, which follow the skin below them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.guides import resampled, way
from surface.fit.wardrobe.patches import BARE, Patches, greville
from surface.fit.wardrobe.skin import Skin
from surface.fit.wardrobe.styles import step

#: By the angle from the front, degrees, about the vertical through (0, 20): the beard's upper and lower line, mm, and
#: the upper line of its part below the mouth.
_ANGLES = np.array([0.0, 8.0, 15.0, 20.0, 24.0, 32.0, 45.0, 60.0, 75.0, 87.0, 95.0])
_UPPER = np.array([-14.0, -12.5, -13.6, -15.0, -17.0, -20.5, -23.5, -21.5, -8.0, 12.0, 14.0])
_LOWER = np.array([-94.0, -94.0, -93.0, -92.0, -90.0, -88.0, -84.0, -76.0, -60.0, -32.0, -4.0])
_BELOW = np.array([-41.0, -41.0, -36.0, -17.0, -11.0, -14.0, -18.0, -17.0, -6.0, 12.0, 14.0])
#: The same of the moustache, at its own angles: roots from the nose outwards, tips along the border of the upper lip
#: and beside the corners of the mouth, not over them: a moustache that hangs over them makes every face look sad.
_LIP_ANGLES = np.array([0.0, 4.0, 8.0, 12.0, 15.0, 17.5, 20.0, 23.0, 26.0, 30.0, 42.0])
_LIP_UPPER = np.array([-14.2, -13.2, -12.4, -13.0, -14.2, -15.6, -17.0, -19.0, -21.0, -22.0, -24.0])
_LIP = np.array([-24.4, -24.8, -25.8, -27.6, -29.6, -31.8, -35.5, -40.0, -43.5, -46.0, -46.0])
_EDGE_DEG = 90.0
_LIPS, _LIP_RADII = np.array([0.0, -33.0]), np.array([26.0, 9.0])
_MOUTH_DEPTH = 76.0  # nearer to the front, skin between the lines of the lips is theirs
_LATER = 0.5  # of the depth at which a shell is dense: so much further inside the longest hairs begin
_SOONER, _SOONER_DEG = 2.6, (30.0, 50.0)  # it is so many times sooner dense beside the mouth, up to these angles
_FIELD_MM = -8.0, 12.0  # inside the beard's lines: where stubble begins, and where it is dense
_DENSER = 1.28  # hair over the lip, which is too short to lie over what is beside it
_GROWS_MM, _TIPS_MM, _JOINS_MM = 9.0, 4.2, 15.0  # over which it grows in from above, ends at the lip and in the beard
_JOINS_DEG = 17.0, 23.0  # of its tips: between these it ends no longer at the lip but in the beard
_THIN_DEG = 15.0  # over which it thins out to either side
_LIP_UNEVEN_MM = 1.7, 0.7  # by how much the first two differ from lock to lock
_PHILTRUM = 0.26, 4.2  # how much of it the hollow below the nose shows, and over how many mm from the middle
_TIPS = 0.25, 0.55  # of the length of hairs: from the one on they have the colour of tips, however few grow
_WIDE_MM = 11.0  # inside its lines, where a beard is dense
_LIP_DEG = 42.0  # from the middle, where it ends: in the beard beside the mouth
_LIP_MM = 2.6  # the same over the lip
_SHADED = 0.14  # by how much locks differ in brightness
_FAN = 0.42  # by how much narrower the moustache's roots lie than its tips: hairs lie outwards from the middle
_BEHIND = 0.8  # mm inside the beard's end at the ear for a degree: there it thins out slowly
_UNEVEN_MM, _UNEVEN_DEG = 1.6, 3.1  # by how much the line at which hairs begin wanders, and how fast
_WANDERS = np.array([[1.0], [0.25], [1.0], [1.0]])  # of that, each line: round the lips, one bare lock is a nick
_SIDE_DEG, _SIDE = (45.0, 86.0), 0.85  # between which it gets shorter towards the ear, and by which share
_HAIRS = 1.0 / 19.0  # tiles of the noise for a mm across hairs
_ROOTS_MM, _SHORTER = 7.0, 10.0  # from a shell's upper line, where hairs are seen in so many times shorter pieces


@dataclass(frozen=True)
class Beard:
    """A beard's measures: thickness, mm, and what the chin adds to it; each shell's share of that and its cover; how
    much of the beard's colour the skin below has; how long a tile of the noise is along hairs, mm."""

    thick: float
    chin: float
    shells: tuple[tuple[float, float], ...]
    cover: float
    grain: float


BEARDS = {
    "beard-full": Beard(4.4, 7.0, ((1.0, 0.46), (0.72, 0.62), (0.40, 0.85)), 0.85, 210.0),
    "beard-short": Beard(1.7, 0.6, ((1.0, 0.48), (0.5, 0.60)), 0.62, 64.0),
}


def inside(points: Floats) -> Floats:
    """(n,) how far inside the beard's lines places on the face (n, 3) lie, mm; negative outside."""
    return np.asarray(_inside_each(points).min(axis=0))


def _inside_each(points: Floats) -> Floats:
    """(4, n) the same of each line: the upper one, that round the lips, the lower one, the end at the ear."""
    y, angle = points[:, 1], _angle(points)
    upper, lower = np.interp(angle, _ANGLES, _UPPER), np.interp(angle, _ANGLES, _LOWER)
    return np.stack([upper - y, _beside_lips(points), y - lower, _BEHIND * (_EDGE_DEG - 2.0 - angle)])


def _beside_lips(points: Floats) -> Floats:
    """(n,) mm from the line round the lips, negative within it."""
    away = points[:, :2] - _LIPS
    out = np.maximum(np.linalg.norm(away / _LIP_RADII, axis=1), 1e-6)
    beside = np.linalg.norm(away, axis=1) * (1.0 - 1.0 / out)
    lips = np.where(out < 1.0, _LIP_RADII[1] * (out - 1.0), beside)
    return np.asarray(np.where(points[:, 2] > _MOUTH_DEPTH, lips, 50.0))


def _angle(points: Floats) -> Floats:
    """(n,) angle from the front of points (n, 3), degrees, about the vertical that the beard's lines are given by."""
    return np.asarray(np.degrees(np.arctan2(np.abs(points[:, 0]), points[:, 2] - 20.0)))


def garment(skin: Skin, beard: Beard) -> list[Patches]:
    """Shells, the outermost first: those of cheeks, jaw and chin, and those of the upper lip."""
    wide = _EDGE_DEG * (1.0 - 2.0 * greville(31, 2))  # so that the outside is outside
    main = _grid(skin, wide, np.interp(np.abs(wide), _ANGLES, _BELOW), np.interp(np.abs(wide), _ANGLES, _LOWER), 11)
    narrow = _LIP_DEG * (1.0 - 2.0 * greville(19, 2))
    top = np.interp((1.0 - _FAN) * np.abs(narrow), _LIP_ANGLES, _LIP_UPPER)
    lip = _grid(skin, narrow, top, np.interp(np.abs(narrow), _LIP_ANGLES, _LIP), 6, _FAN)
    out = []
    for k, (share, cover) in enumerate(beard.shells):
        out.append(_shell(skin, beard, main, (43, 13), (29, 10), share, cover, k, _WIDE_MM, over_lip=False))
        out.append(_shell(skin, beard, lip, (29, 9), (15, 5), share, _DENSER * cover, k, _LIP_MM, over_lip=True))
    return out


def _grid(skin: Skin, angles: Floats, upper: Floats, lower: Floats, rows: int, fan: float = 0.0) -> Floats:
    """(columns, rows, 3) places on the skin between two lines, down each column where control points
    act most; columns begin nearer to the middle by the share ``fan`` of their angle."""
    columns = []
    for angle, top, bottom in zip(np.radians(angles), upper, lower, strict=True):
        t = np.linspace(0.0, 1.0, 40)
        at = angle * (1.0 - fan * (1.0 - t))
        directions = np.column_stack([np.sin(at), np.zeros_like(at), np.cos(at)])
        heights = top + t * (bottom - top)
        columns.append(np.array([_outermost(skin, y, each) for y, each in zip(heights, directions, strict=True)]))
    return resampled(np.array(columns), rows, greville(rows, 2))


def _outermost(skin: Skin, y: float, direction: Floats) -> Floats:
    """Where a level ray from the middle of the head leaves the skin: the outermost samples in a narrow beam."""
    middle = np.array([0.0, y, 20.0])
    own = skin.points[skin.bare]
    ahead = own - middle
    along = ahead @ direction
    off = np.linalg.norm(ahead - along[:, None] * direction, axis=1)
    near = np.flatnonzero((off < 5.0) & (along > 0.0))
    if not len(near):
        return middle + 60.0 * direction
    far = along[near].max()
    share = np.exp(-((off[near] / 2.0) ** 2)) * (along[near] > far - 9.0) + 1e-12
    return np.asarray(middle + direction * (along[near] * share).sum() / share.sum())


def _shell(
    skin: Skin, beard: Beard, ground: Floats, grid: tuple[int, int], fast: tuple[int, int], share: float, cover: float,
    layer: int, full_mm: float, *, over_lip: bool,
) -> Patches:  # fmt: skip
    """One shell over places on the skin (columns, rows, 3), dense from ``full_mm`` inside the beard's lines on;
    that over the lip thins out at its ends and towards the lip."""
    nu, nv, _ = ground.shape
    flat = ground.reshape(-1, 3)
    normals, _ = skin.nearest(flat)
    x, y, z = flat.T
    chin = np.exp(-((x / 26.0) ** 2)) * step(-y, 44.0, 70.0) * step(z, 55.0, 95.0)
    deep = inside(flat)
    thick = beard.thick * min(1.0, 0.1 * full_mm + 0.1)  # less over the lip
    shorter = 1.0 - _SIDE * step(_angle(flat), *_SIDE_DEG)
    height = 0.8 - 0.4 * (1.0 - shorter) + share * shorter * (thick + beard.chin * chin) * step(deep, -3.0, full_mm + 5)
    down = np.array([0.0, -0.5, 0.1]) * (share * beard.chin * chin)[:, None]  # hair falls
    points = (flat + normals * height[:, None] + down).reshape(nu, nv, 3)
    gu, gv = grid
    s, t = np.linspace(0.0, 1.0, gu), np.linspace(0.0, 1.0, gv)
    places = _between(ground, *(np.interp(at, greville(n, 2), np.arange(n)) for at, n in ((s, nu), (t, nv))))
    width = np.linalg.norm(np.diff(places.mean(axis=1), axis=0), axis=1).sum()
    length = np.linalg.norm(np.diff(places, axis=1), axis=2).sum(axis=1).mean()
    s, t = np.meshgrid(s, t, indexing="ij")
    openness = 0.72 + 0.28 * share + 0.0 * s
    if over_lip:
        reached = _reached_over_lip(places, _LIP_DEG * (1.0 - 2.0 * s[:, 0]), layer)
    else:
        reached = _reached(places.reshape(-1, 3), full_mm, share).reshape(gu, gv) * step(t, 0.0, 0.05)
    along = (t * length - _ROOTS_MM * _SHORTER * np.exp(-t * length / _ROOTS_MM)) / beard.grain
    strands = np.stack(
        [s * width * _HAIRS + 2.77 * layer, along, cover * reached - BARE * (1.0 - reached), openness], axis=-1
    )
    tint = share * np.maximum(reached, step(t, *_TIPS))[None]  # roots are darker, and tips are not, however few
    locks = np.random.default_rng(91 + layer).standard_normal((gu, 1)).clip(-2.0, 2.0)
    shade = np.broadcast_to(1.0 + _SHADED * locks, (1, gu, gv))
    return Patches(
        points[None], (2, 2), grid, fast, strands[None], tint, shade, np.zeros((1, nu, nv)), 1.0,
        whole=False,
    )  # fmt: skip


def _reached(places: Floats, full_mm: float, share: float) -> Floats:
    """(n,) how much of a shell's hairs grow at places on the skin (n, 3): fewer towards the beard's lines, and the
    longer they are, the later."""
    each = _inside_each(places)
    each[:2] *= _SOONER - (_SOONER - 1.0) * step(_angle(places), *_SOONER_DEG)
    each += _wandering(places) * _WANDERS
    deep = each.min(axis=0) - _LATER * full_mm * share
    return step(deep, -0.3 * full_mm, 1.2 * full_mm)


def _reached_over_lip(places: Floats, degrees: Floats, layer: int) -> Floats:
    """(gu, gv) the same over the lip, at places (gu, gv, 3) along hairs whose tips lie at angles (gu,): it grows in and
    ends softly, goes over into the beard beside the mouth and shows the hollow below the nose."""
    random = np.random.default_rng(17 + layer)
    begins, ends = (far * random.uniform(-1.0, 1.0, (len(places), 1)) for far in _LIP_UNEVEN_MM)
    along = way(places, 1)
    tips = _TIPS_MM + (_JOINS_MM - _TIPS_MM) * step(np.abs(degrees), *_JOINS_DEG)[:, None]
    grown = step(along + begins, -0.3, _GROWS_MM) * step((along[:, -1:] - along + ends) / tips, 0.0, 1.0)
    thinner = step(_LIP_DEG - np.abs(degrees), 0.0, _THIN_DEG)[:, None]
    return np.asarray(grown * thinner * (1.0 - _PHILTRUM[0] * np.exp(-((places[..., 0] / _PHILTRUM[1]) ** 2))))


def _wandering(places: Floats) -> Floats:
    """(n,) mm by which hairs begin later or sooner at places (n, 3), differently on either side: a beard's line that is
    the same distance from lips and cheeks all along looks cut out."""
    angle = np.degrees(np.arctan2(places[:, 0], places[:, 2] - 20.0)) / _UNEVEN_DEG
    return np.asarray(_UNEVEN_MM * (0.6 * np.sin(angle) + 0.5 * np.sin(2.3 * angle + 1.0) + 0.4 * np.sin(4.1 * angle)))


def _between(rows: Floats, at_u: Floats, at_v: Floats) -> Floats:
    """(gu, gv, 3) values of a grid (nu, nv, 3) at fractions of its rows and columns."""
    i, j = np.arange(len(rows)), np.arange(rows.shape[1])
    along = np.stack([np.stack([np.interp(at_u, i, rows[:, c, k]) for c in j], axis=1) for k in range(3)], axis=-1)
    return np.stack([np.stack([np.interp(at_v, j, row[:, k]) for row in along]) for k in range(3)], axis=-1)


def field(skin: Skin, beard: Beard) -> Floats:
    """(s,) how much of the beard's colour the skin between its hairs has."""
    return np.where(skin.part == 0, beard.cover * step(inside(skin.points), *_FIELD_MM), 0.0)
