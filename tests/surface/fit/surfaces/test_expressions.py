"""Expressions of another head on surfaces: fields of known form come back, rules that cannot be shown are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from relief import named, relief
from scipy.sparse import csr_matrix

from surface.fit.surfaces import SurfaceOptions, head_of
from surface.fit.surfaces.expressions import skin_fields, solve_fields, with_expressions
from surface.fit.surfaces.pieces import make_pieces
from surface.head import Group, HeadData, Jaw, Rule

MM = SurfaceOptions(unit="mm", up="y", forward="z")


def field(points: np.ndarray) -> np.ndarray:
    """A smooth displacement."""
    x, y, _ = points.T / 100
    return np.column_stack([x, 4 * y - x, 2 + x * y])


def spikes(points: np.ndarray) -> np.ndarray:
    """One that changes its sign from point to point."""
    sign = np.where(np.arange(len(points)) % 2, 1.0, -1.0)
    return np.outer(sign, [0.0, 0.0, 3.0])


def other(count: int = 21) -> HeadData:
    """A finer head of the same form, with a jaw."""
    data = head_of(named(face=relief(count)), name="o", options=MM)
    part, ids = data.parts[0], np.arange(count**2, dtype=np.int32)
    groups = [
        Group("mouthSmileLeft", ids, field(part.points).astype(np.float32)),
        Group("spiky", ids, spikes(part.points).astype(np.float32)),
        Group("smooth", ids, field(part.points).astype(np.float32)),
    ]
    share = np.clip(0.5 - part.points[:, 1] / 200, 0, 1)
    rules = [Rule(n, ({"jawOpen": 1.0},)) for n in ("spiky", "smooth")]
    finer = replace(part, groups=groups, jaw=share, mesh={}, budget=(0, 0.01, 7))
    return replace(data, parts=[finer], rules=rules, jaw=Jaw((0, 0, 0), 0.3, (0, 0, 0)))


def test_fields_jaw_and_rules_are_carried() -> None:
    items = named(face=relief())
    bare, source = head_of(items, name="h", options=MM), other()
    moved = with_expressions(bare, make_pieces(items, "h"), source)
    part = moved.parts[0]
    assert [r.group for r in moved.rules] == ["smooth"] and moved.jaw.angle_rad == 0.3
    assert {g.name for g in part.groups} == {"mouthSmileLeft", "smooth"}
    np.testing.assert_array_equal(part.points, bare.parts[0].points)
    smile = next(g for g in part.groups if g.name == "mouthSmileLeft")
    assert np.abs(smile.moves - field(part.points[smile.ids])).max() < 0.25
    assert np.abs(part.jaw - np.clip(0.5 - part.points[:, 1] / 200, 0, 1)).max() < 0.05


def test_fields_end_far_from_the_other_head() -> None:
    fields = skin_fields(other())
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    near = fields.points[fields.points[:, 2].argmax()]
    values = fields.at(np.stack([near, near + np.array([0, 0, 36])]), up)
    assert np.abs(values[0, :3] - field(near[None])[0]).max() < 0.3
    assert np.abs(values[1]).max() == 0.0


def test_undetermined_points_follow_the_mean_over_their_subdomain() -> None:
    basis = csr_matrix(np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 0.0]]))
    found = solve_fields(basis, np.ones(3), np.array([[2.0], [2.0], [0.0]]))
    assert found.values[:2].ravel() == pytest.approx([2.0, 2.0])
    assert (
        abs(found.values[2, 0]) < 1e-6 and found.residual[0] == pytest.approx(0.0, abs=1e-9) and found.whole[0] == 8.0
    )
