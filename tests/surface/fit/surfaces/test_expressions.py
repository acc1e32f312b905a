"""Expressions of another head on surfaces: fields of known form come back, rules that cannot be shown are left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from relief import named, relief
from scipy.sparse import csr_matrix

from surface.fit.surfaces import SurfaceOptions, expressions, head_of
from surface.fit.surfaces.expressions import skin_fields, solve_fields, with_expressions
from surface.fit.surfaces.pieces import make_pieces
from surface.head import Group, HeadData, Jaw, Rule
from surface.head.model.parameters import smoothstep
from surface.mesh.mesh import Mesh

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


def test_samples_deviate_by_an_eighth_of_what_the_surface_was_read_with() -> None:
    class StoppedError(Exception):
        pass

    @dataclass
    class Stand:
        """A piece that only says how finely it is asked for."""

        chord: float

        @property
        def mesh(self) -> Mesh:
            raise StoppedError(self.chord)

    part = head_of(named(face=relief()), name="h", options=MM).parts[0]
    with pytest.raises(StoppedError) as caught:
        expressions.fit_fields(part, Stand(2.0), skin_fields(other()))  # type: ignore[arg-type]
    assert caught.value.args == (0.25,)


def test_a_sample_takes_the_mean_of_four_places_by_the_inverse_square_of_their_distance() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [4, 0, 0]])
    normals = np.tile([0.0, 0, 1], (5, 1))
    fields = expressions.Fields(points, normals, (), np.array([[1.0], [2.0], [4.0], [8.0], [1000.0]]))
    weight = 1 / (np.arange(4) + 0.3) ** 2
    wanted = (weight * [1, 2, 4, 8]).sum() / weight.sum()
    assert fields.at(np.zeros((1, 3)), normals[:1])[0, 0] == pytest.approx(wanted)


def test_a_normal_that_differs_by_one_counts_as_14_mm() -> None:
    up, ahead = [0.0, 0, 1], [1.0, 0, 0]
    apart = 14.0 * np.sqrt(2.0)
    for off, wanted in ((apart - 0.1, 1.0), (apart + 0.1, 2.0)):
        places = np.vstack([np.tile([off, 0, 0], (4, 1)), np.zeros((4, 3))])
        values = np.repeat([[1.0], [2.0]], 4, axis=0)
        fields = expressions.Fields(places, np.repeat([up, ahead], 4, axis=0), (), values)
        found = fields.at(np.zeros((1, 3)), np.array([up]))[0, 0]
        shown = found / (1.0 - smoothstep(np.array([off if wanted == 1.0 else 0.0]), 12.0, 35.0)[0])
        assert shown == pytest.approx(wanted)


@pytest.mark.parametrize(("off", "share"), [(11.9, 1.0), (12.0, 1.0), (23.5, 0.5), (35.0, 0.0), (40.0, 0.0)])
def test_fields_fade_between_12_and_35_mm_from_the_skin(off: float, share: float) -> None:
    fields = expressions.Fields(np.zeros((4, 3)), np.tile([0.0, 0, 1], (4, 1)), (), np.full((4, 1), 3.0))
    found = fields.at(np.array([[0.0, off, 0.0]]), np.array([[0.0, 0, 1]]))
    assert found[0, 0] == pytest.approx(3.0 * share)


def test_areas_are_relative_to_the_mean_and_a_hundredth_of_it_at_least() -> None:
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 2], [9, 9, 9]])
    found = expressions._areas(points, np.array([[0, 1, 2], [1, 3, 2]]))
    one, other_one = 4.0, np.linalg.norm(np.cross([0, 2, 2], [-2, 2, 0]))
    own = np.array([one, one + other_one, one + other_one, other_one, 0.0])
    np.testing.assert_allclose(found, np.maximum(own / own.mean(), 0.01))
    assert found[4] == 0.01
    np.testing.assert_array_equal(expressions._areas(np.zeros((3, 3)), np.array([[0, 1, 2]])), 0.01)


def test_weights_count_and_values_are_pulled_to_their_mean_by_a_hundredth() -> None:
    basis = csr_matrix(np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]]))
    weight, wanted = np.array([1.0, 2.0, 3.0]), np.array([[1.0], [5.0], [3.0]])
    reach = np.array([2.0, 4.0])
    mean = np.array([1 * 1 + 2 * 0.5 * 5, 2 * 0.5 * 5 + 3 * 3]) / reach
    pull = 0.01 * reach + 1e-9 * 4.0
    dense = basis.toarray()
    left = dense.T @ (weight[:, None] * dense) + np.diag(pull)
    values = np.linalg.solve(left, dense.T @ (weight * wanted[:, 0]) + pull * mean)
    found = solve_fields(basis, weight, wanted)
    np.testing.assert_allclose(found.values[:, 0], values)
    np.testing.assert_allclose(found.whole, [1 + 2 * 25 + 3 * 9])
    np.testing.assert_allclose(found.residual, [(weight * (dense @ values - wanted[:, 0]) ** 2).sum()])


def test_groups_are_kept_where_more_than_half_of_them_is_shown_and_shapes_always() -> None:
    names = ("half", "more", "jawOpen")
    fields = expressions.Fields(np.zeros((0, 3)), np.zeros((0, 3)), names, np.zeros((0, 10)))
    whole = np.array([1.0, 2, 1, 1, 2, 1, 1, 2, 1, 99])
    residual = np.array([1.0, 0, 1, 1, 0, 0.9, 1, 2, 1, 0])
    fitted = expressions.FittedFields(np.zeros((0, 10)), whole, residual)
    assert expressions._shown(fields, [fitted, fitted]) == {"more", "jawOpen"}


def test_short_displacements_and_groups_are_dropped_and_the_jaws_share_is_within_0_and_1() -> None:
    part = other().parts[0]
    count = len(part.points)
    values = np.zeros((count, 13))
    values[:3, 0] = [0.26, 0.01, 0.011]
    values[0, 3], values[0, 6], values[0, 9] = 0.25, 3.0, -0.123456
    values[:4, -1] = [-0.5, 1.5, 0.1234567, 0.25]
    names = ("kept", "short", "left out", "left")
    found = expressions._moved(replace(part, groups=[]), values, names, {"kept", "short", "left"})
    assert [g.name for g in found.groups] == ["kept"]
    assert found.groups[0].ids.tolist() == [0, 2]
    np.testing.assert_allclose(found.groups[0].moves, [[0.26, 0, 0], [0.011, 0, 0]], rtol=1e-6)
    assert found.jaw[:4].tolist() == [0.0, 1.0, 0.123457, 0.25]
    values[0, 9] = -0.3123456
    found = expressions._moved(replace(part, groups=[]), values, names, {"left"})
    assert [g.name for g in found.groups] == ["left"] and found.groups[0].moves[0, 0] == np.float32(-0.3123)


def test_displacements_of_groups_stand_three_columns_each_and_the_jaw_is_last() -> None:
    part = other().parts[0]
    ids = np.array([1, 4], np.int32)
    groups = [Group("b", ids, np.array([[1.0, 2, 3], [4, 5, 6]], np.float32))]
    dense = expressions._dense(replace(part, groups=groups), ("a", "b"))
    assert dense.shape == (len(part.points), 7) and dense[ids, 3:6].tolist() == [[1, 2, 3], [4, 5, 6]]
    dense[ids, 3:6] = 0.0
    assert not dense[:, :6].any()
    np.testing.assert_array_equal(dense[:, 6], part.jaw)
