"""Errors of the posed head: a surface that is off by a known way, a bump that the surface lacks, faces left out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from surface.fit.measures.dense import measure_dense
from surface.fit.points.report import FitResult
from surface.fit.reportfile import as_markdown, as_table
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import sources_of


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
def test_it_stands_in_both_reports(result: FitResult) -> None:
    from surface.fit.points.nurbsnet import UniformNet

    nets = [UniformNet(100, 0.5), UniformNet(110, 0.9)]
    table = json.loads(json.dumps(as_table(result.report, nets)))
    worst = table["distances"]["worst"]
    text = as_markdown(result.report, nets, [])
    assert f"greatest error {worst['mm']:.2f} mm: " in text and worst["place"] in text
    assert "| surface to mesh |" in text and "| mesh to surface |" in text
