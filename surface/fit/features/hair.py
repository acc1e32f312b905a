"""Make brows and lashes: small surfaces of their own, rooted in the fitted skin and moved by the same groups.

Each is a strip; its trim loop cuts it into a comb of hairs. s runs along the strip (u), t from root to tip (v).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.fit.points.refine import Fitted
from surface.fit.points.solve import basis

DEGREES = (3, 2)
END_LASH = 0.045  # distance of the first and the last lash from the strip's ends
TIP = 0.003  # half the width of a lash's tip, in the strip's length: a finer one would be cut into pieces
LASH_LEAN, LASH_LIFT = 0.85, 0.5  # of a lash's length: away from the eyeball, up along it
ROOT_MM = 0.4  # height above the skin of the lashes' roots: its triangles may be up to a quarter higher


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

    Parameters
    ----------
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
    return fit_strip(np.stack(rows, axis=2), 10, 3, [_comb(hairs, lean=0.012, thick=0.42 if upper else 0.36)])


def _comb(hairs: int, *, lean: float, thick: float) -> Floats:
    """One closed line: a thin continuous root, and hairs that taper to :data:`TIP`; ``thick`` in their distances."""
    rng, root = np.random.default_rng(5), 0.22 * thick
    tops = []
    for k in range(hairs):
        s = END_LASH + (1.0 - 2.0 * END_LASH) * (k + 0.5) / hairs  # the outermost lean out, and stay whole
        half = thick / hairs
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
