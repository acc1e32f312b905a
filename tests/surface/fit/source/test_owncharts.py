"""Unusable texture coordinates are noticed, and replaced by charts without flips, overlaps or spikes."""

from dataclasses import replace

import numpy as np
import pytest
import uv_traps
from slit_sheet import slit_sheet

from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.points.solve import basis
from surface.fit.source import owncharts
from surface.fit.source.chart import make_chart
from surface.fit.source.flatten import crosses_itself
from surface.fit.source.islands import Island, boundary_loops, signed_areas
from surface.fit.source.layout import lay_out, middle_line, open_flat_holes, straighten_holes
from surface.fit.source.mesh import FitMesh
from surface.fit.source.owncharts import own_islands, usable_islands
from surface.fit.source.uvcheck import measure_uv, unevenness


def every(mesh: FitMesh) -> np.ndarray:
    return np.arange(len(mesh.faces))


def one_to_one(island: Island) -> bool:
    """No face the wrong way round, and no outline that crosses itself."""
    return bool((signed_areas(island) > 0).all()) and not crosses_itself(island.uv[boundary_loops(island)[0]])


def test_good_coordinates_stay_as_they_are():
    mesh = slit_sheet()
    notes: list[str] = []
    (island,) = usable_islands(mesh, every(mesh), 1.0, notes, "face", face=True)
    assert notes == []
    np.testing.assert_array_equal(np.unique(island.uv, axis=0), np.unique(mesh.uv, axis=0))
    moved = replace(mesh, uv=mesh.uv + np.array([3.0, -2.0]))  # another tile
    assert not measure_uv(moved, every(moved), face=True).faults()


@pytest.mark.parametrize(
    ("trap", "said"),
    [
        (uv_traps.bare, "none at all"),
        (uv_traps.flipped, "faces flipped"),
        (uv_traps.overlapping, "a seam of"),
        (lambda m: replace(m, uv=m.uv * [1.0, 0.0]), "100 % of the surface squeezed"),
    ],
)
def test_traps_are_named_and_replaced_by_one_disc_with_the_slit_as_a_hole(trap, said):
    mesh = trap(slit_sheet())
    notes: list[str] = []
    (island,) = usable_islands(mesh, every(mesh), 1.0, notes, "face", face=True)
    assert said in notes[0] and "omote made its own, 1 chart without flipped" in notes[0]
    assert one_to_one(island) and len(island.faces) == len(mesh.faces) and len(boundary_loops(island)) == 2
    again = replace(mesh, uv=island.uv, face_uv=island.faces)
    order = replace(again, faces=np.where(island.faces >= 0, island.vertex[island.faces], -1))
    assert measure_uv(order, every(order)).apart_mm == 0.0


def test_a_bad_island_is_replaced_and_the_other_stays():
    mesh = slit_sheet()
    count = len(mesh.uv)
    two = replace(
        mesh, vertices=np.vstack([mesh.vertices, mesh.vertices + np.array([300.0, 0, 0])]),
        faces=np.vstack([mesh.faces, mesh.faces + count]),
        uv=np.vstack([mesh.uv, uv_traps.flipped(mesh).uv + 2.0]), face_uv=np.vstack([mesh.faces, mesh.faces + count]),
        deltas=np.tile(mesh.deltas, (1, 2, 1)),
    )  # fmt: skip
    notes: list[str] = []
    made, given = usable_islands(two, every(two), 1.0, notes, "coat")
    assert "the file has not everywhere usable texture coordinates" in notes[0]
    assert given.vertex.max() < count <= made.vertex.min()
    np.testing.assert_array_equal(np.unique(given.uv, axis=0), np.unique(mesh.uv, axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("seam_in_front", [False, True])
def test_a_decimated_face_with_cylindrical_coordinates_is_fitted_without_spikes(shared, seam_in_front):
    mesh = uv_traps.around(uv_traps.arkit_like(shared), seam_in_front=seam_in_front)
    assert "faces flipped" in measure_uv(mesh, every(mesh), face=True).faults()[0]
    islands = own_islands(mesh, every(mesh), face=True)
    assert all(one_to_one(i) for i in islands)
    (face,) = lay_out(mesh, islands[:1])
    assert len(face.faces) > 0.95 * len(mesh.faces)
    face = open_flat_holes(straighten_holes(face))
    holes = sorted((face.uv[loop] for loop in boundary_loops(face)[1:]), key=lambda rim: -float(np.ptp(rim[:, 0])))
    assert all(np.ptp(rim, axis=0)[0] > np.ptp(rim, axis=0)[1] for rim in holes[:3])  # mouth and eyes lie along u
    if seam_in_front:
        check_no_spikes(mesh, face, 1000)


def check_no_spikes(mesh: FitMesh, island: Island, points: int) -> None:
    """Fit an island; nowhere, samples or not, may it move further than the mesh does around."""
    request = FitRequest(points, neutral_mm=0.25, shape_mm=0.45, finest=0.9, astray_mm=1.8, spare=60)
    fitted = fit_chart(mesh, make_chart(mesh, [island], normalise=False, downweight_slivers=True), request)
    uv, corner, _ = uv_traps.strewn(island)
    rows = basis(fitted.net, uv)
    for move, delta in zip(fitted.moves, mesh.deltas, strict=True):
        longest = np.linalg.norm(delta[corner], axis=2).max(axis=1)
        assert (np.linalg.norm(rows @ move, axis=1) < longest + 3.0).all()


def test_contradicting_samples_raise_no_spike():
    mesh = uv_traps.overlapping(slit_sheet())
    island = Island(np.arange(len(mesh.uv)), mesh.uv, mesh.faces)
    request = FitRequest(400, coarse=0.1)
    fitted = fit_chart(mesh, make_chart(mesh, [island], normalise=False), request)
    moved = np.linalg.norm(basis(fitted.net, uv_traps.strewn(island)[0]) @ fitted.moves[0], axis=1)
    assert moved.max() < np.linalg.norm(mesh.deltas[0], axis=1).max() + 2.5


def test_bent_holes_become_straight_along_u():
    mesh = slit_sheet()
    bent = mesh.uv + np.column_stack([np.zeros(len(mesh.uv)), 0.5 * (mesh.uv[:, 0] - 0.5) ** 2 + 0.2 * mesh.uv[:, 0]])
    island = Island(np.arange(len(mesh.uv)), bent, mesh.faces)
    straight = straighten_holes(island)
    rim = straight.uv[boundary_loops(straight)[1]]
    u = np.linspace(rim[:, 0].min(), rim[:, 0].max(), 21)[1:-1]
    middle, half = middle_line(rim, u)
    assert np.ptp(middle) < 0.2 * half.min() and (signed_areas(straight) > 0).all()


def test_a_hole_whose_corners_share_one_place_leaves_all_others_where_they_are():
    """A face is missing whose corners are one point in (u, v): it has no width to straighten along."""
    mesh = slit_sheet()
    island = Island(np.arange(len(mesh.uv)), mesh.uv.copy(), mesh.faces)
    inner = np.setdiff1d(np.arange(len(mesh.faces)), np.flatnonzero(np.isin(mesh.faces, boundary_rows(island)).any(1)))
    gone = inner[0]
    island.uv[island.faces[gone]] = island.uv[island.faces[gone, 0]]
    holed = island.subset(np.arange(len(mesh.faces)) != gone)
    assert len(boundary_loops(holed)) == len(boundary_loops(island)) + 1
    np.testing.assert_allclose(straighten_holes(holed).uv, straighten_holes(island).uv, atol=1e-9)


def boundary_rows(island: Island) -> np.ndarray:
    return np.concatenate(boundary_loops(island))


def squeezed(mesh: FitMesh, times: float) -> FitMesh:
    """The mesh with the upper tenth of its texture squeezed along v."""
    v = mesh.uv[:, 1]
    return replace(mesh, uv=np.column_stack([mesh.uv[:, 0], np.where(v > 0.9, 0.9 + (v - 0.9) / times, v)]))


def test_a_face_whose_texture_is_squeezed_in_places_gets_evener_charts():
    notes: list[str] = []
    mild, strong = squeezed(slit_sheet(), 1.5), squeezed(slit_sheet(), 3.2)
    (given,) = usable_islands(mild, every(mild), 1.0, notes, "face", face=True)
    assert notes == [] and given.uv[:, 1].max() == pytest.approx(mild.uv[:, 1].max())
    before = unevenness(strong, usable_islands(strong, every(strong), 1.0, notes, "nose"))
    assert notes == [] and before > 2.5  # only a face is charted again for that
    (made,) = usable_islands(strong, every(strong), 1.0, notes, "face", face=True)
    assert unevenness(strong, [made]) < 0.7 * before
    assert one_to_one(made) and len(boundary_loops(made)) == 2
    assert len(notes) == 1 and "squeezed" in notes[0] and "omote made its own" in notes[0]


def test_a_face_is_charted_again_above_an_unevenness_of_2_2_where_that_saves_15_per_cent(monkeypatch):
    mesh = slit_sheet()
    given, made = ([Island(np.arange(len(mesh.uv)), mesh.uv + shift, mesh.faces)] for shift in (0.0, 1.0))
    measured: dict[int, float] = {}
    monkeypatch.setattr(owncharts, "unevenness", lambda _, islands: measured[id(islands)])
    monkeypatch.setattr(owncharts, "own_islands", lambda *_, **__: charts)
    for before, after, charts, again in (
        (2.2, 0.1, made, False), (2.3, 0.1, made, True), (4.0, 3.4, made, True), (4.0, 3.41, made, False),
        (4.0, 9.0, [], False),
    ):  # fmt: skip
        measured.update({id(given): before, id(charts): after})
        notes: list[str] = []
        found = owncharts._evener(mesh, every(mesh), 1.0, notes, given, owncharts.NO_FACES)
        assert found is (made if again else given), (before, after)
        told = f"face: its texture coordinates are squeezed {before:.1f} times in places: omote made its own"
        assert notes == ([told] if again else [])


def test_islands_without_width_or_area_are_dropped():
    mesh = slit_sheet()
    for width, count in ((2e-6, 1), (0.5e-6, 0)):
        narrow = replace(mesh, uv=(mesh.uv - mesh.uv.min(axis=0)) / np.ptp(mesh.uv, axis=0) * [1.0, width])
        assert len(owncharts._as_given(narrow, every(narrow))) == count
        assert len(owncharts._as_given(replace(narrow, uv=narrow.uv[:, ::-1]), every(narrow))) == count
    assert owncharts._as_given(mesh, owncharts.NO_FACES) == []


@pytest.mark.parametrize(("count", "share", "cut"), [(24, 0.5, False), (25, 0.06, False), (25, 0.07, True)])
def test_a_region_is_cut_where_more_than_6_per_cent_of_over_24_faces_are_squeezed(monkeypatch, count, share, cut):
    faces, asked = np.arange(count), []
    monkeypatch.setattr(owncharts, "squeezed_share", lambda _, flat: share if len(flat.faces) == count else 0.0)
    in_two = owncharts.in_two
    monkeypatch.setattr(owncharts, "in_two", lambda mesh, part: asked.append(len(part)) or in_two(mesh, part))
    found = owncharts._unwrapped(slit_sheet(), faces)
    assert sum(len(island.faces) for island in found) == count
    assert asked[:1] == ([count] if cut else []) and (len(found) > 1) == cut


def test_a_face_without_area_gets_no_chart():
    mesh = slit_sheet()
    flat = replace(mesh, vertices=mesh.vertices * [1.0, 0.0, 0.0])
    assert owncharts._unwrapped(flat, np.array([7])) == []
    assert len(owncharts._unwrapped(mesh, np.array([7]))) == 1
