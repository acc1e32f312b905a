"""surface.deform.batch: copies agree with deformations of their own, and with nothing else's moves."""

from __future__ import annotations

import numpy as np
import pytest

from surface import DCPSurface
from surface.deform.batch import DeformationBatch, slices
from surface.deform.deformation import Deformation
from tests.surface import shapes

KINDS = {"regular": lambda: shapes.hills(12), "scattered": lambda: shapes.scattered(80, 3), "closed": shapes.torus}


@pytest.fixture(scope="module", params=[*KINDS, "positions"])
def pair(request: pytest.FixtureRequest) -> tuple[Deformation[DCPSurface], Deformation[DCPSurface]]:
    """Two deformations of one mesh."""
    surface = KINDS.get(request.param, KINDS["regular"])()
    mesh = surface.tessellate()
    first, second = (Deformation(surface, mesh, normals=request.param != "positions") for _ in range(2))
    return first, second


@pytest.fixture
def source(pair: tuple[Deformation[DCPSurface], Deformation[DCPSurface]]) -> Deformation[DCPSurface]:
    return pair[0]


@pytest.fixture
def alone(pair: tuple[Deformation[DCPSurface], Deformation[DCPSurface]]) -> Deformation[DCPSurface]:
    return pair[1]


def places(source: Deformation[DCPSurface], seed: int, scale: float = 0.2) -> np.ndarray:
    return source.points + np.random.default_rng(seed).normal(0.0, scale, source.points.shape)


def test_each_copy_is_as_a_deformation_of_its_own(
    source: Deformation[DCPSurface], alone: Deformation[DCPSurface]
) -> None:
    batch = DeformationBatch(source, 3)
    wanted = [places(source, k) for k in range(3)]
    assert all(batch.place(k, xyz) for k, xyz in enumerate(wanted))
    assert batch.compute() == [0, 1, 2] and not batch.compute()
    for k, xyz in enumerate(wanted):
        alone.set_points(xyz)
        alone.refresh()
        np.testing.assert_array_equal(batch.vertices[k], alone.vertices)
        np.testing.assert_array_equal(batch.normals[k], alone.normals)
        np.testing.assert_array_equal(batch.points[k], xyz)


def test_only_copies_that_moved_are_computed(source: Deformation[DCPSurface]) -> None:
    batch, before = DeformationBatch(source, 4), source.vertices.copy()
    assert not batch.place(1, source.points.copy()) and batch.compute() == []
    assert batch.place(2, places(source, 7)) and batch.compute() == [2]
    for k in (0, 1, 3):
        np.testing.assert_array_equal(batch.vertices[k], before)
    assert np.abs(batch.vertices[2] - before).max() > 0.1
    np.testing.assert_array_equal(source.vertices, before)


def test_a_copy_that_goes_far_away_keeps_its_digits(
    source: Deformation[DCPSurface], alone: Deformation[DCPSurface]
) -> None:
    batch = DeformationBatch(source, 2)
    away = places(source, 1) + np.array([3e4, 0.0, -2e4])
    batch.place(1, away)
    batch.compute()
    alone.set_points(away)
    exact = alone.surface.evaluate(source.mesh.uv, source.mesh.side)
    size = np.ptp(source.points, axis=0).max()
    assert np.abs(batch.vertices[1] - exact).max() < 4e-3 + 1e-6 * size
    np.testing.assert_allclose(batch.vertices[1], alone.vertices, rtol=0.0, atol=4e-3)


@pytest.mark.parametrize(
    ("xyz", "why"),
    [(np.zeros((2, 3)), "shape"), (np.nan, "finite"), (np.inf, "finite"), (1e300, "within")],
)  # fmt: skip
def test_what_cannot_be_computed_is_refused_and_changes_nothing(
    source: Deformation[DCPSurface], xyz: np.ndarray | float, why: str
) -> None:
    batch = DeformationBatch(source, 1)
    wrong = xyz if isinstance(xyz, np.ndarray) else np.full(source.points.shape, xyz)
    with pytest.raises(ValueError, match=why):
        batch.place(0, wrong)
    assert batch.compute() == []
    np.testing.assert_array_equal(batch.points[0], source.points)


@pytest.mark.parametrize("copy", [-1, 2])
def test_a_copy_that_there_is_not_is_refused(source: Deformation[DCPSurface], copy: int) -> None:
    batch = DeformationBatch(source, 2)
    with pytest.raises(IndexError, match=f"copy {copy}: there are 2"):
        batch.place(copy, source.points + 1.0)
    assert batch.compute() == []


def test_no_copies_are_no_batch(source: Deformation[DCPSurface]) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        DeformationBatch(source, 0)


def test_arrays_belong_to_the_batch(source: Deformation[DCPSurface]) -> None:
    batch = DeformationBatch(source, 1)
    for array in (batch.points, batch.vertices, batch.normals):
        assert not array.flags.writeable
    assert batch.nbytes >= batch.vertices.nbytes + batch.normals.nbytes


def test_slices_are_no_larger_than_they_may_be() -> None:
    sizes = np.array([3, 4, 5, 100, 1, 1, 1])
    np.testing.assert_array_equal(slices(sizes, 8), [0, 2, 3, 4, 7])
    np.testing.assert_array_equal(slices(sizes[:0], 8), [0, 0])
