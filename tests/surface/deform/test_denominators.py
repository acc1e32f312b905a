"""Sums of weights against scipy's B-splines in float64, however the weights are kept."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.interpolate import BSpline

from surface import DCPSurface
from surface.bench.bench import sheet
from surface.deform import denominators as module
from surface.deform.deformation import Deformation
from surface.deform.denominators import MAX_SUM, MIN_SUM, farthest, first_unusable


def along(knots: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m,) a blending function of these knots and its derivative at places (m,)."""
    p = len(knots) - 2
    lower = [np.zeros(len(at)) if own[0] == own[-1] else value(own, at) / (own[-1] - own[0])
             for own in (knots[:-1], knots[1:])]  # fmt: skip
    return value(knots, at), p * (lower[0] - lower[1])  # Piegl and Tiller, The NURBS Book, Eq. (2.7)


def value(knots: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(m,) a blending function of these knots at places (m,)."""
    return np.nan_to_num(BSpline.basis_element(np.asarray(knots, np.float64), extrapolate=False)(at))


def inside(uv: np.ndarray) -> np.ndarray:
    """Places (m, 2) a little within their bounds, at which some functions jump."""
    return np.clip(uv, uv.min(axis=0) + 1e-9, uv.max(axis=0) - 1e-9)


def dense(deformation: Deformation[DCPSurface]) -> np.ndarray:
    """(3, m, n): b w, b_u w and b_v w of every vertex and control point."""
    surface, (u, v) = deformation.surface, inside(deformation.mesh.uv).T
    out = np.zeros((3, len(u), surface.n))
    for i in range(surface.n):
        (a, da), (b, db) = along(surface.knots_u[i], u), along(surface.knots_v[i], v)
        out[:, :, i] = surface.weights[i] * np.stack([a * b, da * b, a * db])
    return out


def lanes_of(deformation: Deformation[DCPSurface], c: int) -> np.ndarray:
    """The vertices of a cell in the order of its lanes."""
    first, last = deformation.mesh.cell_start[c : c + 2]
    packed = deformation.storage.packed
    if packed.order_at[c] < 0:
        return np.arange(first, last)
    return np.asarray(first + packed.order[packed.order_at[c] :][: last - first].astype(np.int64))


def factored() -> DCPSurface:
    """A sheet with other weights, whose cells mostly have factors."""
    plain, _ = sheet(1_000)
    ku, kv, *_ = plain.arrays()
    return DCPSurface(plain.points, np.random.default_rng(3).uniform(0.5, 2.0, plain.n), list(ku), list(kv))


def deformed(kind: str, normals: bool) -> Deformation[DCPSurface]:
    """A surface most of whose cells keep their weights in this way."""
    if kind == "factors":
        return Deformation(factored(), sheet(1_000)[1], normals=normals)
    surface = shapes.scattered(60, 2)
    made = Deformation(surface, surface.tessellate(chord_error=0.1, max_depth=4), normals=normals)
    if kind == "blocks":
        made.set_weights(np.arange(surface.n), surface.weights * np.linspace(0.8, 1.2, surface.n))
    return made


@pytest.mark.parametrize("normals", [True, False])
@pytest.mark.parametrize("kind", ["factors", "packed", "blocks"])
def test_sums_are_those_of_the_blending_functions(kind: str, normals: bool) -> None:
    deformation = deformed(kind, normals)
    factors, packed = deformation.storage
    kept = {"factors": factors.rows_at >= 0, "packed": packed.packed_at >= 0}
    kept["blocks"] = ~kept["factors"] & ~kept["packed"]
    assert kept[kind].mean() > 0.6
    weights, arrays, starts = dense(deformation), deformation._arrays, deformation.lists.tile_start
    sums, heaviest = weights.sum(axis=2), np.abs(weights).sum(axis=2)[: 3 if normals else 1].max(axis=0)
    for c in np.flatnonzero(kept[kind]):
        lanes = lanes_of(deformation, c)
        held = slice(8 * starts[c], 8 * starts[c] + len(lanes))
        power = powers_of(deformation, c)[: len(lanes)]
        np.testing.assert_allclose(np.ldexp(arrays["inv_w"][held], -power), 1.0 / sums[0, lanes], rtol=1e-5)
        assert (arrays["inv_w"][held.stop : 8 * starts[c + 1]] == 1.0).all()  # lanes that fill up the last tile
        if normals:
            slopes = arrays["dw"][16 * starts[c] : 16 * starts[c + 1]].reshape(-1, 2, 8).transpose(1, 0, 2)
            scale = np.abs(weights[1:]).sum(axis=2).max()
            near = {"atol": 1e-4 * scale, "rtol": 1e-4} if kind == "packed" else {"atol": 1e-5 * scale, "rtol": 1e-5}
            slopes = slopes * steps_of(deformation, c)
            np.testing.assert_allclose(slopes.reshape(2, -1)[:, : len(lanes)], sums[1:, lanes], **near)
        if kind == "packed":
            heaviest_steps(deformation, c, weights[: 1 + 2 * normals, lanes], arrays["heavy"][c])
        elif kind != "factors":
            assert arrays["heavy"][c] == pytest.approx(heaviest[lanes].max(), rel=1e-5)
        else:
            groups = heaviest_group(deformation, c, normals)
            assert arrays["heavy"][c] == pytest.approx(max(heaviest[lanes].max(), groups), rel=1e-5)


def steps_of(deformation: Deformation[DCPSurface], c: int) -> np.ndarray:
    """(2, t, 1) the steps of a cell's tiles in which derivatives are kept; 1 where they are not."""
    packed, tiles = deformation.storage.packed, int(np.diff(deformation.lists.tile_start)[c])
    if packed.packed_at[c] < 0:
        return np.ones((2, tiles, 1))
    return packed.slope_step[packed.packed_at[c] :][:tiles].T[..., None]


def powers_of(deformation: Deformation[DCPSurface], c: int) -> np.ndarray:
    """The exponents of a cell's lanes times whose powers of two weights are kept; 0 where they are kept as they are."""
    packed, tiles = deformation.storage.packed, int(np.diff(deformation.lists.tile_start)[c])
    if packed.packed_at[c] < 0:
        return np.zeros(8 * tiles, np.int16)
    return packed.power[8 * packed.packed_at[c] :][: 8 * tiles]


def heaviest_steps(deformation: Deformation[DCPSurface], c: int, weights: np.ndarray, found: float) -> None:
    """The greatest sum of the numbers that kernels multiply by places: ``weights (3, lanes, n)``, of derivatives in
    steps, or ``(1, lanes, n)`` without these."""
    sums = np.abs(weights).sum(axis=2)
    units = np.ldexp(1.0, powers_of(deformation, c)[None, : weights.shape[1]])
    if len(weights) > 1:
        steps = np.repeat(steps_of(deformation, c)[..., 0], 8, axis=1)[:, : weights.shape[1]]
        units = np.concatenate([units, steps])
    assert found == pytest.approx((sums / units).max(), rel=1e-3)


def heaviest_group(deformation: Deformation[DCPSurface], c: int, normals: bool) -> float:
    """The greatest sum of factors in u without signs, of the points of a cell with the same blending function in v."""
    surface, lists, mesh = deformation.surface, deformation.lists, deformation.mesh
    ids = lists.ids[lists.ids_at[c] : lists.ids_at[c] + lists.rows[c]]
    u, v = inside(mesh.uv)[mesh.cell_start[c] : mesh.cell_start[c + 1]].T
    groups: dict[bytes, list[np.ndarray]] = {}
    for i in ids:
        both = np.stack(along(surface.knots_u[i], u))[: 1 + normals]
        in_v = np.stack(along(surface.knots_v[i], v))[: 1 + normals].astype(np.float32)
        groups.setdefault(in_v.tobytes(), []).append(np.abs(both) * surface.weights[i])
    return max(float(np.sum(group, axis=0).max()) for group in groups.values())


def test_the_first_vertex_without_a_usable_sum_is_found() -> None:
    """Three cells of 3, 9 and 2 vertices; the second one's lanes are in another order."""
    cell_start, tile_start = np.array([0, 3, 12, 14]), np.array([0, 1, 3, 4])
    order, order_at, none = (
        np.array([99, 8, 7, 6, 5, 4, 3, 2, 1, 0], np.uint16),
        np.array([-1, 1, -1]),
        np.zeros(0, "f4"),
    )

    def found(inv_w: np.ndarray, dw: np.ndarray = none, cells: tuple[int, ...] = (0, 1, 2)) -> int:
        return int(first_unusable(np.array(cells), cell_start, tile_start, inv_w, dw, order_at, order))

    good, slopes = np.ones(32, np.float32), np.zeros(64, np.float32)
    assert found(good) == -1
    for bad in (np.inf, 0.0, np.nan):
        inv_w = good.copy()
        inv_w[[3, 7, 17, 26]] = bad  # lanes that fill up tiles are no vertices
        assert found(inv_w) == -1
        inv_w[[2, 24]] = bad
        assert found(inv_w) == 2
        assert found(inv_w, cells=(1, 2)) == 12
        inv_w = good.copy()
        inv_w[16] = bad  # the ninth lane of the second cell, which is its first vertex
        assert found(inv_w) == 3
    for at in (16, 24):
        dw = slopes.copy()
        dw[at + 1] = -np.inf
        assert found(good, dw) == 3 + 7
    half = slopes.copy()
    half[[0, 8]] = 0.4 * np.finfo(np.float32).max
    assert found(good, half) == -1
    half[[0, 8]] *= 2.0  # each is a number, but not their sum
    assert found(good, half) == 0


def test_a_sum_that_float32_has_few_digits_for_is_no_sum() -> None:
    deformation = deformed("blocks", False)
    arrays, lists = deformation._arrays, deformation.lists
    sums = 1.0 / arrays["inv_w"].astype(np.float64)
    small = np.float32(MIN_SUM / np.median(sums))
    lists.value *= small
    module.denominators(deformation._addresses, np.arange(len(lists.rows)))
    vertices = np.concatenate([
        8 * lists.tile_start[c] + np.arange(np.diff(lists.cell_start)[c]) for c in range(len(lists.rows))
    ])  # fmt: skip
    near = np.abs(sums / np.median(sums) - 1.0) < 1e-5
    checked = vertices[~near[vertices]]
    assert np.array_equal(np.isinf(arrays["inv_w"][checked]), sums[checked] * small < MIN_SUM)
    assert 0 < np.isinf(arrays["inv_w"]).sum() < len(checked)


def test_how_far_points_may_be_away_depends_on_weights_above_one() -> None:
    assert farthest(np.array([0.1, 0.5])) == MAX_SUM == farthest(np.zeros(0))
    assert farthest(np.array([2.0, 8.0, 4.0])) == MAX_SUM / 8.0
    assert 10.0 * MAX_SUM < float(np.finfo(np.float32).max) < 100.0 * MAX_SUM


def test_a_sum_of_packed_weights_is_judged_with_its_power_of_two() -> None:
    deformation = deformed("packed", False)
    arrays, packed, starts = deformation._arrays, deformation.storage.packed, deformation.lists.tile_start
    cells = np.flatnonzero(packed.packed_at >= 0)
    sums = dense(deformation)[0].sum(axis=1)
    smaller = round(np.log2(np.median(sums) / MIN_SUM))
    packed.power -= smaller
    module.denominators(deformation._addresses, cells)
    refused, below = list[bool](), list[bool]()
    for c in cells:
        lanes = lanes_of(deformation, c)
        refused += np.isinf(arrays["inv_w"][8 * starts[c] :][: len(lanes)]).tolist()
        below += (np.ldexp(sums[lanes], -smaller) < MIN_SUM).tolist()
    assert refused == below and 0 < sum(below) < len(below)
