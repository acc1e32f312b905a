"""Errors of the posed head: a surface that is off by a known way, a bump that the surface lacks, faces left out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from lash_strip import LONG, TALL, strip
from lash_strip import mesh as lash_mesh

from surface.check.subject import Subject
from surface.fit.api import fit_mesh
from surface.fit.measures.dense import _cut_off, _Pair, measure_dense
from surface.fit.measures.mend import faults_of
from surface.fit.points.nurbsnet import UniformNet
from surface.fit.points.report import FitResult, FittedPart
from surface.fit.reportfile import as_markdown, as_table
from surface.fit.source.chart import make_chart
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names, sources_of
from surface.head import Head
from surface.head.model.data import Group, Rule
from surface.head.model.parameters import SHAPES


def measured(result: FitResult, mesh: FitMesh, **changed: object):
    """Against a mesh that is not the one that was fitted."""
    other = replace(mesh, **changed)
    return measure_dense(result.head, other, sources_of(other.names), result.parts)


@pytest.mark.slow
def test_a_good_fit_is_near_both_ways_in_every_shape(result: FitResult, mesh: FitMesh) -> None:
    dense = result.report.dense
    assert dense is not None and dense.worst is not None
    (part,) = dense.parts.values()
    assert set(part) == {"neutral", *sources_of(mesh.names)}
    assert max(b.to_mesh.rms for b in part.values()) < 0.5 and max(b.to_surface.rms for b in part.values()) < 0.5
    assert dense.worst.mm == max(max(b.to_mesh.max, b.to_surface.max) for b in part.values())
    assert dense.added == () and dense.left_out == ()


@pytest.mark.slow
def test_a_head_that_is_off_says_by_how_much(result: FitResult, mesh: FitMesh) -> None:
    (own,) = result.report.dense.parts.values()
    (part,) = measured(result, mesh, vertices=mesh.vertices + np.array([0.0, 0.0, 7.0])).parts.values()
    assert part["neutral"].to_mesh.rms == pytest.approx(7.0, rel=0.25)
    assert part["neutral"].to_mesh.rms > 5 * own["neutral"].to_mesh.rms


@pytest.mark.slow
def test_a_bump_that_the_surface_lacks_is_found_from_the_mesh(result: FitResult, mesh: FitMesh) -> None:
    k = next(iter(sources_of(mesh.names).values()))[0]
    deltas = mesh.deltas.copy()
    bump = int(np.argmin(np.linalg.norm(mesh.uv - [0.25, 0.75], axis=1)))
    vertex = int(mesh.faces[mesh.face_uv == bump][0])
    deltas[k, vertex] += [0.0, 0.0, 30.0]
    dense = measured(result, mesh, deltas=deltas)
    assert dense.worst.shape == mesh.names[k] and dense.worst.mm == pytest.approx(30.0, abs=4.0)
    assert not dense.worst.to_mesh and "mesh to surface" in str(dense.worst)
    assert dense.lines()[0].startswith(f"greatest error {dense.worst.mm:.2f} mm: shape {mesh.names[k]}, ")


@pytest.mark.slow
def test_faces_that_no_part_holds_are_named(result: FitResult, mesh: FitMesh) -> None:
    n = len(mesh.vertices)
    more = replace(
        mesh, vertices=np.concatenate([mesh.vertices, mesh.vertices[:3] + 50.0]),
        faces=np.concatenate([mesh.faces, [[n, n + 1, n + 2, -1]]]),
        face_uv=np.concatenate([mesh.face_uv, [[0, 1, 2, -1]]]),
        deltas=np.concatenate([mesh.deltas, np.zeros((len(mesh.deltas), 3, 3))], axis=1),
        piece=np.append(np.zeros(len(mesh.faces), int), 1), pieces=("skin", "hat"),
    )  # fmt: skip
    dense = measure_dense(result.head, more, sources_of(more.names), result.parts)
    assert dense.left_out == ("hat (1 faces)",)
    assert any("no fitted part holds: hat" in line for line in dense.lines())


@pytest.mark.slow
def test_correctives_that_change_a_shape_on_purpose_are_left_out_and_named(result: FitResult, mesh: FitMesh) -> None:
    """One takes a shape 9 mm further than the mesh does: that is no error of the fit, and is said."""
    name = next(n for n in sources_of(mesh.names) if n in SHAPES)
    part = result.head.parts[0]
    everywhere = np.arange(len(part.points), dtype=np.int32)
    moves = np.tile(np.array([[0.0, 0.0, 9.0]], np.float32), (len(part.points), 1))
    own = f"{name}*{name}"
    head = replace(
        result.head, parts=[replace(part, groups=[*part.groups, Group(own, everywhere, moves)])],
        rules=[*result.head.rules, Rule(own, ({name: 1.0}, {name: 1.0}))],
    )  # fmt: skip
    dense = measure_dense(head, mesh, sources_of(mesh.names), result.parts)
    assert dense.worst == result.report.dense.worst and dense.corrected == (name,)
    line = f"changed on purpose by correctives and the tongue's rules, and measured without them: {name}"
    assert line in dense.lines() and line not in result.report.dense.lines()
    far = measure_dense(head, mesh, sources_of(mesh.names), result.parts, fit_alone=True).otherwise
    assert far.shape == name and far.mm == pytest.approx(9.0, abs=1.5), "contacts may add to it"
    other = replace(head, rules=[*result.head.rules, Rule(own.replace("*", "+"), ({name: 1.0}, {name: 1.0}))])
    assert measure_dense(other, mesh, sources_of(mesh.names), result.parts).corrected == ()


@pytest.mark.slow
def test_what_lies_in_folds_as_a_whole_is_not_measured_instead_of_perfect(result: FitResult, mesh: FitMesh) -> None:
    part = result.parts[0]
    folded = replace(part, chart=replace(part.chart, folded=np.ones_like(part.chart.folded)))
    dense = measure_dense(result.head, mesh, sources_of(mesh.names), [folded])
    both = dense.parts[part.name]["neutral"]
    assert not both.to_mesh.measured and not both.to_surface.measured and both.folds.max > 0.0
    assert faults_of(dense, [folded], 1.0) == ["nothing of the fitted face could be measured: all of it lies in folds"]
    report = replace(result.report, dense=dense)
    nets = [UniformNet(100, 0.5), UniformNet(110, 0.9)]
    table = json.loads(json.dumps(as_table(report, nets), allow_nan=False))
    assert table["distances"]["parts"][part.name]["neutral"]["to_mesh"] == {"rms": None, "p99": None, "max": None}
    assert f"| {part.name} | surface to mesh | - | - | - | - | " in as_markdown(report, nets, [])


@pytest.mark.slow
def test_it_stands_in_both_reports(result: FitResult) -> None:
    nets = [UniformNet(100, 0.5), UniformNet(110, 0.9)]
    table = json.loads(json.dumps(as_table(result.report, nets)))
    distances = table["distances"]
    worst = min(filter(None, (distances["worst"], distances["apart"])), key=lambda spot: spot["mm"])
    text = as_markdown(result.report, nets, [])
    assert f"greatest error {worst['mm']:.2f} mm: " in text and worst["place"] in text
    assert "| surface to mesh |" in text and "| mesh to surface |" in text


@pytest.mark.slow
def test_what_contacts_move_on_purpose_is_told_from_errors_of_the_fit(mesh: FitMesh) -> None:
    """The lower lip of a shape goes up through the upper one; contacts keep them apart, the fit follows the mesh."""
    through = -2.0 * mesh.deltas[:1]
    crossing = replace(mesh, names=(*mesh.names, "mouthShrugLower"), deltas=np.concatenate([mesh.deltas, through]))
    dense = fit_mesh(Loaded(crossing, map_names(crossing.names)), "sheet", lambda part, done: None).report.dense
    assert dense.worst.shape == "mouthShrugLower" and dense.worst.mm > 3.0
    assert dense.apart.mm < 0.4 * dense.worst.mm
    assert dense.lines()[0] == f"greatest error {dense.apart}"
    assert dense.lines()[1].startswith("with contacts, which move lips, lids and tongue out of each other")
    assert dense.lines()[1].endswith(str(dense.worst))
    assert dense.parted.shape == "mouthShrugLower" and dense.parted.mm > 0.6 * dense.worst.mm
    assert dense.lines()[2].startswith(
        f"contacts move what would pass through itself on purpose by {dense.parted.mm:.2f} mm at most: "
        f"shape mouthShrugLower, {dense.parted.place} ({dense.parted.part})"
    )


@pytest.mark.slow
def test_lips_that_a_mesh_opens_wide_are_not_kept_closed(mesh: FitMesh) -> None:
    """A drawn character's round mouth in mouthPucker, and a shape that parts its lips by little."""
    shapes = mesh.deltas[:1], 0.1 * mesh.deltas[:1]
    wide = replace(
        mesh, names=(*mesh.names, "mouthPucker", "mouthPressLeft"), deltas=np.concatenate([mesh.deltas, *shapes])
    )
    made = fit_mesh(Loaded(wide, map_names(wide.names)), "sheet", lambda part, done: None)
    opens = made.head.contacts[0].seal.opens
    assert opens["mouthPucker"] == 1.4 and opens["mouthPressLeft"] == -0.4
    dense = made.report.dense
    assert dense.sealed.shape == "mouthPressLeft" and 0.1 < dense.sealed.mm < 2.0
    assert any(line.startswith("contacts move lips that stay together on purpose by") for line in dense.lines())


@pytest.mark.slow
def test_what_was_fitted_alone_is_measured_as_a_head_without_contacts_is(mesh: FitMesh) -> None:
    """In the same pass, and only where contacts move something."""
    through = -2.0 * mesh.deltas[:1]
    crossing = replace(mesh, names=(*mesh.names, "mouthShrugLower"), deltas=np.concatenate([mesh.deltas, through]))
    made = fit_mesh(Loaded(crossing, map_names(crossing.names)), "sheet", lambda part, done: None)
    given = crossing, sources_of(crossing.names), made.parts
    both = measure_dense(made.head, *given, fit_alone=True)
    other = replace(made.head, contacts=[])
    alone = measure_dense(other, *given)
    assert both.apart == alone.worst and both.apart.mm < both.worst.mm
    assert replace(both, apart=None, parted=None, sealed=None, sticking={}, turned={}) == replace(
        measure_dense(made.head, *given), sticking={}, turned={}
    )
    assert measure_dense(other, *given, fit_alone=True).apart is None


@pytest.mark.slow
def test_without_contacts_there_is_one_greatest_error(result: FitResult, mesh: FitMesh) -> None:
    head = replace(result.head, contacts=[])
    dense = measure_dense(head, mesh, sources_of(mesh.names), result.parts, fit_alone=True)
    assert dense.apart is None and not any("with contacts" in line for line in dense.lines())


@pytest.mark.slow
def test_distances_that_grow_elsewhere_are_all_found(result: FitResult, mesh: FitMesh) -> None:
    """Where a surface lay on the mesh, and another one of its poses does not."""
    subject = Subject(Head(result.head))
    part = next(p for p in result.parts if p.name == "face")
    number = next(k for k, p in enumerate(subject.parts) if p.name == "face")
    data = next(p for p in result.head.parts if p.name == "face")
    quick, whole = (_Pair(part, data, number, subject, mesh) for _ in range(2))
    before = subject.rest[number].astype(np.float64)
    away = before + np.where(np.arange(len(before))[:, None] % 7 == 0, [0.0, 0.0, 6.0], 0.0)
    greater = quick.greater_elsewhere(away, mesh.vertices, before, quick.distances(before, mesh.vertices), 2.0)
    (to_mesh, fold), (to_surface, _) = whole.distances(away, mesh.vertices)
    assert (to_mesh > 2.0).sum() > 10
    for found, wanted, left_out in ((greater[0][0], to_mesh, fold), (greater[1][0], to_surface, greater[1][1])):
        beyond = (wanted > 2.0) & ~left_out
        np.testing.assert_allclose(found[beyond], wanted[beyond], rtol=1e-9)


def test_what_outlines_leave_of_a_card_is_measured_alone() -> None:
    part, (whole, islands) = strip()[0], lash_mesh()
    chart = make_chart(whole, islands, normalise=False)
    fitted = FittedPart("lash_1", chart, None, whole.vertices)  # type: ignore[arg-type]
    assert not _cut_off(whole, fitted, replace(part, loops=chart.loops)).any()
    left = np.array([[-1.0, -1.0], [0.5 * LONG, -1.0], [0.5 * LONG, TALL + 1.0], [-1.0, TALL + 1.0]])
    assert _cut_off(whole, fitted, replace(part, loops=[left])).tolist() == [False, True, True, False]
