"""Control points that stick out of the mesh are put right; what cannot be mended is refused."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from surface.fit.measures import mend
from surface.fit.measures.dense import measure_dense
from surface.fit.measures.mend import faults_of, mend_spikes, turned_faces
from surface.fit.points.report import Both, DenseErrors, Errors, FitResult, Turned
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import sources_of
from surface.head.model.data import Group, HeadData


def fine_point(head: HeadData) -> int:
    """A control point in the middle of the left upper quarter."""
    part = head.parts[0]
    centres = np.column_stack([part.knots_u.mean(axis=1), part.knots_v.mean(axis=1)])
    return int(np.argmin(np.linalg.norm(centres - [0.3, 0.78], axis=1)))


def spiked(head: HeadData, mm: float) -> HeadData:
    part = head.parts[0]
    points = part.points.copy()
    points[fine_point(head)] += [0.0, 0.0, mm]
    return replace(head, parts=[replace(part, points=points), *head.parts[1:]])


def greatest(head: HeadData, result: FitResult, mesh: FitMesh) -> float:
    dense = measure_dense(head, mesh, sources_of(mesh.names), result.parts)
    return max(b.to_mesh.max for b in dense.parts[head.parts[0].name].values())


@pytest.mark.slow
def test_a_spike_at_rest_is_mended(result: FitResult, mesh: FitMesh) -> None:
    head = spiked(result.head, 150.0)
    before = greatest(head, result, mesh)
    mended, dense, notes = mend_spikes(head, mesh, sources_of(mesh.names), result.parts, 1.0)
    assert before > 15.0 and greatest(mended, result, mesh) < 4.0
    assert len(notes) >= 1 and "neutral" in notes[0] and dense.worst is not None


@pytest.mark.slow
def test_a_spike_in_a_shape_is_mended_and_the_rest_stays(result: FitResult, mesh: FitMesh) -> None:
    part = result.head.parts[0]
    bad = fine_point(result.head)
    groups = []
    for g in part.groups:
        moves = np.zeros((len(part.points), 3), np.float32)
        moves[g.ids] = g.moves
        moves[bad] += np.float32([0.0, 0.0, 150.0]) * (g.name == "jawOpen")
        ids = np.flatnonzero(np.abs(moves).max(axis=1) > 0).astype(np.int32)
        groups.append(Group(g.name, ids, moves[ids]))
    head = replace(result.head, parts=[replace(part, groups=groups), *result.head.parts[1:]])
    mended, _, notes = mend_spikes(head, mesh, sources_of(mesh.names), result.parts, 1.0)
    assert greatest(head, result, mesh) > 15.0 and greatest(mended, result, mesh) < 4.0
    assert "jawOpen" in notes[0]
    np.testing.assert_array_equal(mended.parts[0].points, part.points)


@pytest.mark.slow
def test_a_good_fit_is_left_as_it_is(result: FitResult, mesh: FitMesh) -> None:
    head, _, notes = mend_spikes(result.head, mesh, sources_of(mesh.names), result.parts, 1.0)
    assert head is result.head and notes == []


@pytest.mark.slow
def test_what_cannot_be_mended_is_a_fault(result: FitResult, mesh: FitMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mend, "NEIGHBOURS", 0)
    _, dense, _ = mend_spikes(spiked(result.head, 300.0), mesh, sources_of(mesh.names), result.parts, 1.0)
    faults = faults_of(dense, result.parts, 1.0)
    assert any("mm off the mesh at rest" in f for f in faults)
    good = measure_dense(result.head, mesh, sources_of(mesh.names), result.parts)
    assert faults_of(good, result.parts, 1.0) == [] and faults_of(good, [], 1.0) == []


def measured(*shapes: tuple[str, float, float], turned: float = 0.0) -> DenseErrors:
    """Errors of a face, 99 % and greatest by shape, and how much of it is turned over."""
    both = {s: Both(Errors(0.0, p99, 0.0), Errors(0.0, 0.0, most), Errors(0.0, 0.0, 0.0)) for s, p99, most in shapes}
    over = {("face", "jawOpen"): Turned(turned, np.zeros((1, 2)))}
    return DenseErrors({"face": both}, None, None, (), (), 1, {}, over)


@pytest.mark.parametrize(
    ("dense", "scale", "said"),
    [
        (measured(("neutral", 3.9, 19.0), ("jawOpen", 9.0, 19.0), turned=99.0), 1.0, []),
        (measured(("neutral", 4.1, 9.0)), 1.0, ["does not follow the mesh: 1 % of it is 4 mm away or more"]),
        (measured(("neutral", np.nan, 9.0)), 1.0, ["does not follow the mesh"]),
        (measured(("neutral", 1.0, 19.0), ("jawOpen", 1.0, 48.0)), 1.0, ["48 mm off the mesh with jawOpen = 1"]),
        (measured(("neutral", 1.0, 48.0), ("jawOpen", 1.0, 49.0)), 1.0, ["48 mm off the mesh at rest"]),
        (measured(("neutral", 1.0, 1.0), turned=101.0), 1.0, ["101 mm² of the fitted face are inside out with jaw"]),
        (measured(("neutral", 7.0, 39.0), turned=390.0), 2.0, []),
        (measured(("neutral", 9.0, 41.0), turned=410.0), 2.0, ["does not follow", "41 mm off", "410 mm²"]),
    ],
)
def test_a_face_that_is_far_off_or_turned_over_is_faulty(dense: DenseErrors, scale: float, said: list[str]) -> None:
    faults = faults_of(dense, [SimpleNamespace(name="face")], scale)  # type: ignore[list-item]
    assert len(faults) == len(said) and all(word in fault for word, fault in zip(said, faults, strict=True))


def by_shape(**most: float) -> DenseErrors:
    """How far a face sticks out of the mesh in each shape."""
    none = Errors(0.0, 0.0, 0.0)
    both = {s: Both(Errors(0.0, 0.0, mm), Errors(0.0, 0.0, 99.0), none) for s, mm in most.items()}
    return DenseErrors({"face": both}, None, None, (), (), 1)


def over(**mm2: float) -> DenseErrors:
    """How much of a face is turned over in each shape."""
    turned = {("face", s): Turned(most, np.zeros((1, 2))) for s, most in mm2.items()}
    return replace(by_shape(neutral=0.0), turned=turned)


def test_what_sticks_out_at_rest_is_mended_there_and_else_in_every_shape() -> None:
    assert mend._wanted(by_shape(neutral=6.0, jawOpen=6.0), 6.0) == []
    assert mend._wanted(by_shape(neutral=6.0, jawOpen=7.04, mouthLeft=9.0), 6.0) == [
        ("face", "jawOpen", "7.0 mm"), ("face", "mouthLeft", "9.0 mm"),
    ]  # fmt: skip
    assert mend._wanted(by_shape(neutral=6.1, jawOpen=99.0), 6.0) == [("face", "neutral", "6.1 mm")]


def test_what_is_turned_over_at_rest_is_mended_there_and_else_in_every_shape() -> None:
    assert mend._turned(over(neutral=10.0, jawOpen=10.0), 1.0) == []
    assert mend._turned(over(neutral=10.0, jawOpen=10.6), 1.0) == [("face", "jawOpen", "11 mm²")]
    assert mend._turned(over(neutral=40.6, jawOpen=99.0), 2.0) == [("face", "neutral", "41 mm²")]
    assert mend._turned(over(neutral=39.0, jawOpen=39.0), 2.0) == []


@pytest.mark.parametrize(
    ("after", "better"),
    [
        (by_shape(neutral=7.9, jawOpen=2.0), True), (by_shape(neutral=8.1, jawOpen=2.0), False),
        (by_shape(neutral=1.0, jawOpen=10.0), True), (by_shape(neutral=1.0, jawOpen=10.1), False),  # nothing else more
    ],
)  # fmt: skip
def test_a_mend_is_kept_where_what_stuck_out_does_by_a_fifth_less(after: DenseErrors, better: bool) -> None:
    before, wanted = by_shape(neutral=10.0, jawOpen=2.0), [("face", "neutral", "10.0 mm")]
    assert mend._is_better(after, before, wanted, 6.0) == better


def test_points_along_a_bent_surface_may_end_a_little_off_it() -> None:
    before, wanted = over(neutral=40.0), [("face", "neutral", "40 mm²")]
    for most, left, better in ((3.0, 20.0, True), (3.1, 20.0, False), (0.0, 20.1, False), (0.0, 0.0, True)):
        after = replace(by_shape(neutral=most), turned=over(neutral=left).turned)
        assert mend._is_better(after, before, wanted, 6.0) == better


def test_a_face_of_which_nothing_was_measured_is_mended_by_what_is_inside_out() -> None:
    """All of it lies in folds."""

    def unmeasured(mm2: float) -> DenseErrors:
        return replace(over(neutral=mm2), parts={})

    wanted = [("face", "neutral", "40 mm²")]
    assert mend._is_better(unmeasured(20.0), unmeasured(40.0), wanted, 6.0)
    assert not mend._is_better(unmeasured(20.1), unmeasured(40.0), wanted, 6.0)


def net(count: int = 6, slits: tuple[tuple[float, float, float], ...] = ()) -> SimpleNamespace:
    """As much of a part as points are filled by: a square net over (u, v), 0..1."""
    u, v = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(0, 1, count)], indexing="ij"))
    knots = [np.repeat(x[:, None], 5, axis=1) + np.arange(-2, 3) * 0.1 for x in (u, v)]
    return SimpleNamespace(points=np.zeros((count * count, 3)), knots_u=knots[0], knots_v=knots[1], slits=slits)


def centres(part: SimpleNamespace) -> np.ndarray:
    return np.column_stack([part.knots_u.mean(axis=1), part.knots_v.mean(axis=1)])


def test_bad_points_are_filled_by_a_plane_through_the_good_ones() -> None:
    part = net()
    flat = centres(part) @ np.array([[10.0, 0.0, 3.0], [0.0, 20.0, -4.0]]) + [1.0, 2.0, 3.0]
    bad = np.isin(np.arange(36), [0, 14, 15, 20])
    found = mend._filled(part, np.where(bad[:, None], 500.0, flat), bad)  # type: ignore[arg-type]
    np.testing.assert_allclose(found, flat, atol=1e-9)
    few = ~np.isin(np.arange(36), [3, 9])
    kept = mend._filled(part, flat, few)  # type: ignore[arg-type]
    np.testing.assert_array_equal(kept, flat)  # two points make no plane


def test_nearer_points_count_more() -> None:
    part = net(3)
    values = np.zeros((9, 3))
    values[1] = 1.0  # beside the bad corner; the next on that side is as far again
    found = mend._filled(part, values, np.arange(9) == 0)  # type: ignore[arg-type]
    at = centres(part)[1:]
    weight = 1.0 / np.linalg.norm(at, axis=1)
    system = np.column_stack([np.ones(8), at]) * weight[:, None]
    wanted = np.linalg.lstsq(system, values[1:, 0] * weight, rcond=None)[0][0]
    np.testing.assert_allclose(found[0], wanted, atol=1e-6)


def test_a_slit_hides_what_lies_on_its_other_side_as_far_as_it_goes() -> None:
    part = net(slits=((0.5, 0.2, 0.6),))
    others = np.array([[0.4, 0.9], [0.4, 0.1], [0.9, 0.9], [0.1, 0.9], [0.61, 0.9], [0.19, 0.9], [0.4, 0.5]])
    seen = mend._sees(part, np.array([0.4, 0.1]), others)  # type: ignore[arg-type]
    assert seen.tolist() == [False, True, False, False, False, False, True]
    beside = mend._sees(part, np.array([0.7, 0.1]), others)  # type: ignore[arg-type]
    assert beside.tolist() == [False, True, True, False, True, False, True]
    before = mend._sees(part, np.array([0.1, 0.1]), others)  # type: ignore[arg-type]
    assert before.tolist() == [False, True, False, True, False, True, True]


def test_a_shape_keeps_only_the_points_that_it_moves() -> None:
    part = net()
    moves = np.array([[0, 1.23456, 0], [0, 9, 0], [0, 0, -2.0]], np.float32)
    group = Group("jawOpen", np.array([7, 14, 35], np.int32), moves)
    filled = mend._group_filled(part, group, np.arange(36) == 0)  # type: ignore[arg-type]
    assert filled.name == "jawOpen" and filled.ids.dtype == np.int32
    assert set(filled.ids.tolist()) == {0, 7, 14, 35}  # the corner goes with its neighbours, the others stay still
    np.testing.assert_allclose(filled.moves[filled.ids == 7], [[0, 1.2346, 0]], atol=1e-6)
    np.testing.assert_allclose(filled.moves[filled.ids == 35], [[0, 0, -2.0]])


def test_neighbours_are_the_nearest_in_the_chart_and_theirs() -> None:
    part, bad = net(), np.arange(36) == 14
    away = np.linalg.norm(centres(part) - centres(part)[14], axis=1)
    assert mend._grown(part, bad, 0).tolist() == bad.tolist()  # type: ignore[arg-type]
    once = mend._grown(part, bad, 1)  # type: ignore[arg-type]
    assert once.sum() == mend.NEIGHBOURS and away[once].max() <= np.sort(away)[mend.NEIGHBOURS - 1] + 1e-12
    twice = mend._grown(part, bad, 2)  # type: ignore[arg-type]
    assert (twice & ~once).any() and twice[once].all() and bad.sum() == 1


@pytest.mark.slow
def test_surface_that_is_turned_over_is_found_and_mended(result: FitResult, mesh: FitMesh) -> None:
    """Control points far beyond their neighbours, along the surface: nothing sticks out, but it runs back."""
    part, bad = result.head.parts[0], fine_point(result.head)
    points = part.points.copy()
    near = np.linalg.norm(points - points[bad], axis=1) < 18.0
    points[near, 0] -= 2.0 * (points[near, 0] - points[bad, 0])  # mirrored
    head = replace(result.head, parts=[replace(part, points=points), *result.head.parts[1:]])
    good = measure_dense(result.head, mesh, sources_of(mesh.names), result.parts)
    before = measure_dense(head, mesh, sources_of(mesh.names), result.parts)
    assert (
        all(spot.mm2 < 1.0 for spot in good.turned.values())
        and before.turned[part.name, "neutral"].mm2 > mend.TURNED_MM2
    )
    mended, after, notes = mend_spikes(head, mesh, sources_of(mesh.names), result.parts, 1.0)
    assert after.turned.get((part.name, "neutral"), Turned(0.0, points)).mm2 < 1.0 and "mm²" in notes[0]
    assert greatest(mended, result, mesh) < 4.0  # points may stay elsewhere along the surface


def test_faces_turned_over_in_the_texture_are_counted(mesh: FitMesh) -> None:
    assert turned_faces(mesh) == []
    uv = mesh.uv.copy()
    inner = int(np.argmin(np.linalg.norm(uv - [0.25, 0.25], axis=1)))
    uv[inner] += [0.09, 0.0]
    (note,) = turned_faces(replace(mesh, uv=uv))
    assert note.endswith("are flipped in (u, v)") and 1 <= int(note.split()[0]) <= 4


def test_faces_without_texture_coordinates_are_not_turned_over(mesh: FitMesh) -> None:
    bare = np.full_like(mesh.face_uv, -1)
    assert turned_faces(replace(mesh, uv=np.zeros((0, 2)), face_uv=bare)) == []
    some = np.where(np.arange(len(bare))[:, None] % 3 == 0, -1, mesh.face_uv)
    assert turned_faces(replace(mesh, face_uv=some)) == []
