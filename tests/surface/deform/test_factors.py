"""Weights that are kept as factors are those of the surface."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface import DCPSurface
from surface.bench.bench import sheet
from surface.deform import factors
from surface.deform.deformation import Deformation
from surface.deform.factors import HEAD, STEP, _count_groups, _put_whole_windows, _put_windows
from surface.deform.lists import LANES, Basis, Lists, build_lists
from surface.deform.storage import Storage, compress, expand
from surface.mesh.domain import Domain, Slit
from surface.mesh.mesh import Mesh

pytestmark = pytest.mark.skipif(not factors.PICKS_FAST, reason="this processor has no instruction for picks")


def weighted_sheet() -> tuple[DCPSurface, Mesh]:
    """A sheet with other weights, whose cells mostly have factors."""
    plain, mesh = sheet(2_000)
    ku, kv, *_ = plain.arrays()
    rng = np.random.default_rng(3)
    return DCPSurface(plain.points, rng.uniform(0.5, 2.0, plain.n), list(ku), list(kv)), mesh


def factored(surface: DCPSurface, mesh: Mesh) -> tuple[Lists, Storage]:
    lists = build_lists(surface, mesh, True)
    return lists, compress(Basis.of(surface), lists, mesh, surface.arrays()[4])


def test_factors_give_the_weights_of_the_surface() -> None:
    surface, mesh = weighted_sheet()
    lists, storage = factored(surface, mesh)
    made = storage.factors
    held = np.flatnonzero(made.rows_at >= 0)
    assert len(held) > 0.8 * len(lists.rows)
    expand(lists, storage, held[::2])
    assert set(np.flatnonzero(made.rows_at >= 0)) == set(held[1::2])
    plain = build_lists(surface, mesh, True)
    for c in held[::2]:
        tiles, rows, order = np.diff(lists.tile_start)[c], lists.rows[c], lists.ids_at[c] + np.arange(lists.rows[c])
        assert lists.room[c] == rows == plain.rows[c]
        for name, each in (("value", 1), ("slope", 2)):
            mine, whole = (
                getattr(own, name)[each * own.at[c] :][: each * tiles * rows * LANES].reshape(tiles, rows, -1)
                for own in (lists, plain)
            )
            mine, whole = mine[:, np.argsort(lists.ids[order])], whole[:, np.argsort(plain.ids[order])]
            assert np.abs(mine - whole).max() <= 4e-7 * np.abs(whole).max(), (c, name)


def test_windows_hold_the_places_of_their_own_eight_lanes() -> None:
    picks = np.full(HEAD + 2 * STEP, -1, np.int64)
    assert _put_windows(np.arange(13), 13, 20, 1, 2, picks)  # each eight lanes take eight places in a row
    assert picks[1] == 20 and picks[HEAD + 16 + 1] == 0 and picks[HEAD + STEP + 16 + 1] == 8
    assert picks[HEAD + 8 : HEAD + 16].tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    assert picks[HEAD + STEP + 8 : HEAD + STEP + 16].tolist() == [0, 1, 2, 3, 4, 0, 0, 0]
    assert _put_windows(np.array([0, 7, 3]), 3, 12, 0, 1, picks) and picks[0] == 12 and picks[HEAD + 16] == 0
    assert not _put_windows(np.array([0, 8, 3]), 3, 12, 0, 1, picks)  # nine places are too many
    assert _put_windows(np.array([9, 11]), 2, 12, 0, 1, picks) and picks[HEAD + 16] == 4  # no window ends beyond
    assert picks[HEAD : HEAD + 8].tolist() == [5, 7, 0, 0, 0, 0, 0, 0]


def test_tiles_with_the_same_eight_places_share_a_whole_window() -> None:
    picks, ranks = np.full(HEAD + 3 * STEP, -1, np.int64), np.full(24, -1)
    rank = np.array([0, 1, 0, 1, 2, 3, 2, 3, 8, 9, 8, 9, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3])  # the last tile: six vertices
    assert _put_whole_windows(rank, 22, 1, 3, ranks, picks) == 24 == picks[1]
    assert ranks.tolist() == [*rank, 3, 3]  # lanes without a vertex repeat the last one
    assert picks[HEAD + STEP * np.arange(3) + 17].tolist() == [0, 8, 16]
    again = np.concatenate([rank[:16], rank[:8]])
    assert _put_whole_windows(again, 24, 0, 3, ranks, picks) == 16 == picks[0]
    assert picks[HEAD + STEP * np.arange(3) + 16].tolist() == [0, 8, 0]
    assert (picks[HEAD:].reshape(3, STEP)[:, :16] == np.tile(np.arange(8), 2)).all()


def test_points_with_equal_knots_are_one_group() -> None:
    knots, degrees = (
        np.array([[0.0, 1, 2, 3, 9], [0, 1, 2, 3, 7], [0, 1, 2, 3, 9], [0, 1, 2, 3, 9]]),
        np.array([3, 2, 3, 2]),
    )
    assert _count_groups(knots, degrees, np.array([0, 2])) == 1
    assert _count_groups(knots, degrees, np.array([1, 3])) == 1  # what follows a point's own knots does not count
    assert _count_groups(knots, degrees, np.arange(4)) == 2


def test_tiles_take_whole_windows_where_that_needs_fewer_operations() -> None:
    surface, mesh = sheet(2_000)
    taken = {}
    for normals in (False, True):
        made = surface.deformation(mesh, normals=normals).storage.factors
        taken[normals] = made.picks[made.picks_at[made.rows_at >= 0] + 2]
    assert taken[False].mean() > 0.7  # all cells of eight and more tiles, which pick in few different ways
    assert 0 < taken[True].mean() < taken[False].mean()  # with slopes, more lanes in sums over points cost more


def test_factors_take_less_memory_and_neighbours_share_them() -> None:
    surface, mesh = sheet(10_000)
    plain = build_lists(surface, mesh, False).value.nbytes
    deformation = surface.deformation(mesh, normals=False)
    assert deformation.nbytes <= 0.6 * plain
    made = deformation.storage.factors
    assert made.nbytes == sum(array.nbytes for array in vars(made).values() if isinstance(array, np.ndarray))
    assert len(np.unique(made.factor_u)) <= 4 * 30  # four rows of factors reach each column of cells, whatever the row
    assert len(made.factors) < 0.02 * plain / 4


def test_every_point_knows_its_rows() -> None:
    surface, mesh = weighted_sheet()
    lists, _ = factored(surface, mesh)
    for i in (0, 17, surface.n - 1):
        cells, rows = lists.entries_of(i)
        assert (lists.ids[lists.ids_at[cells] + rows] == i).all() and len(cells) > 0


@pytest.mark.parametrize("normals", [True, False])
def test_updates_of_any_kind_agree_with_a_new_evaluation(normals: bool) -> None:
    surface, mesh = weighted_sheet()
    deformation, rng = Deformation(surface, mesh, normals=normals), np.random.default_rng(1)
    assert (deformation.storage.factors.rows_at >= 0).any()

    def check() -> None:
        points, su, sv = deformation.surface.derivatives(mesh.uv, mesh.side)
        assert np.abs(deformation.vertices - points).max() < 2e-5  # a ten-millionth of 200
        if normals:
            wanted = np.cross(su, sv)
            wanted /= np.linalg.norm(wanted, axis=1)[:, None]
            assert np.abs(deformation.normals - wanted).max() < 1e-4  # some cells are packed, with 16 bits

    check()
    for _ in range(4):  # the first stores numerators, those after it add differences
        deformation.move([30], rng.normal(size=3))
        check()
    deformation.move(np.arange(0, surface.n, 3), rng.normal(size=3))
    check()
    deformation.set_weights([40], [3.0])
    check()
    deformation.move([40, 41], rng.normal(size=3))
    check()
    deformation.refresh()
    check()


def test_a_refused_change_of_knots_leaves_factors() -> None:
    surface, mesh = sheet(2_000)
    deformation = surface.deformation(mesh)
    before, used = deformation.storage.factors.rows_at.copy(), deformation.lists.used
    with pytest.raises(ValueError, match="uncovered"):
        deformation.set_knots(0, [0.5, 0.6, 0.7], [0.5, 0.6, 0.7])
    assert np.array_equal(before, deformation.storage.factors.rows_at) and deformation.lists.used == used
    deformation.move([0, 1], [0.0, 0.0, 1.0])
    assert np.abs(deformation.vertices - deformation.surface.evaluate(mesh.uv)).max() < 2e-5


def test_sides_of_a_slit_have_factors_of_their_own() -> None:
    """The surface jumps at u = 1/2, so that vertices of the slit have two limits there."""
    knots, net = np.repeat([0.0, 0.5, 1.0], 4), np.zeros((8, 8, 3))
    net[..., 0], net[..., 1] = np.meshgrid(np.arange(8.0), np.arange(8.0), indexing="ij")
    net[4:, :, 2] = 5.0
    surface = DCPSurface.from_nurbs(3, 3, knots, knots, net)
    mesh = surface.tessellate(min_depth=3, max_depth=3, domain=Domain((0, 1, 0, 1), slits=[Slit("u", 0.5, 0.0, 1.0)]))
    deformation = surface.deformation(mesh)
    assert (deformation.storage.factors.rows_at >= 0).any() and len(np.unique(mesh.side)) > 1
    assert np.abs(deformation.vertices - surface.derivatives(mesh.uv, mesh.side)[0]).max() < 1e-6


def test_cells_for_which_factors_cost_more_keep_plain_weights() -> None:
    surface, mesh = sheet(2_000)
    lists = build_lists(surface, mesh, False)
    made = factors.factorize(Basis.of(surface), lists, mesh, cost=(0.0, 0.0))
    assert (made.rows_at == factors.PLAIN).all() and len(lists.value) == lists.used > 0
    scattered = shapes.scattered(60, 2)  # every point has knots of its own: no groups
    mesh = scattered.tessellate(chord_error=0.3, max_depth=4)
    assert (scattered.deformation(mesh).storage.factors.rows_at == factors.PLAIN).all()
