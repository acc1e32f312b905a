"""surface.view.draw.vertex_sums and the differences that are measured beside it, against sums in 64 bits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import ModuleType, SimpleNamespace
from typing import Any

import moderngl
import numpy as np
import pytest
from scipy.interpolate import NdBSpline
from scipy.spatial.transform import Rotation

from surface.view.draw.vertex_sums import VertexSums
from surface.view.pictures.offscreen import open_context

VERTICES, POINTS = 3000, 400
FLAT = 8
"""Before this vertex are those whose points determine no normal."""
STILL = SimpleNamespace(vector=np.zeros(3), pivot=np.zeros(3))


@pytest.fixture(scope="module")
def ctx(gl: None) -> Iterator[moderngl.Context]:
    ctx = open_context()
    yield ctx
    ctx.release()


@pytest.fixture(scope="module")
def sums() -> Any:
    """Sums of random vertices, one of which no control point reaches, one of which a point reaches twice."""
    random = np.random.default_rng(5)
    counts = random.integers(4, 30, VERTICES)
    counts[:FLAT] = 1
    counts[FLAT - 1] = 0
    start = np.concatenate([[0], np.cumsum(counts)])
    ids = random.integers(0, POINTS, start[-1])
    ids[start[FLAT] : start[FLAT] + 2] = 3
    weights = random.normal(size=(len(ids), 3))
    return SimpleNamespace(
        points=POINTS, start=start, ids=ids, weights=weights, share=random.uniform(size=VERTICES).astype(np.float32)
    )


def wanted(sums: Any, points: np.ndarray, turn: Any = STILL) -> np.ndarray:
    """(m, 6) positions and normals by the definition: numpy's sums, Rodrigues' rotation by scipy."""
    vertex = np.repeat(np.arange(VERTICES), np.diff(sums.start))
    out = np.zeros((VERTICES, 3, 3))
    np.add.at(out, vertex, sums.weights.astype(np.float32)[:, :, None] * points[sums.ids, None].astype(float))
    normal = np.cross(out[:, 1], out[:, 2])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    turned = Rotation.from_rotvec(sums.share[:, None] * turn.vector)
    place = turn.pivot + turned.apply(out[:, 0] - turn.pivot)
    return np.hstack([place, turned.apply(np.divide(normal, length, where=length > 0, out=np.zeros_like(normal)))])


def written(ctx: moderngl.Context, own: Any, points: np.ndarray, turn: Any = STILL) -> np.ndarray:
    """(m, 6) what the graphics processor writes, in two ranges."""
    out = []
    for first, last in ((0, 1000), (1000, VERTICES)):
        buffer = ctx.buffer(reserve=24 * (last - first))
        own.update(points, turn)
        own.write(buffer, first, last)
        out.append(np.frombuffer(buffer.read(), np.float32).reshape(-1, 6))
        buffer.release()
    return np.concatenate(out)


def apart(found: np.ndarray, right: np.ndarray) -> float:
    """Greatest distance of positions; most normals have to be near as well: some are of two nearly parallel slopes."""
    normals = np.abs(found[:, 3:] - right[:, 3:]).max(axis=1)
    assert np.quantile(normals[FLAT:], 0.99) < 1e-3
    return float(np.linalg.norm(found[:, :3] - right[:, :3], axis=1).max())


@pytest.fixture
def differences(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("gpu_differences")


@pytest.mark.parametrize("kept", [False, True])
def test_positions_and_normals_are_the_sums_turned(
    ctx: moderngl.Context, sums: Any, differences: ModuleType, kept: bool
) -> None:
    points = np.random.default_rng(1).normal(scale=80.0, size=(POINTS, 3)).astype(np.float32)
    turn = SimpleNamespace(vector=np.array([0.2, -0.4, 0.1]), pivot=np.array([0.0, -20.0, 5.0]))
    own = differences.KeptSums(ctx, sums) if kept else VertexSums(ctx, sums)
    assert apart(written(ctx, own, points, turn), wanted(sums, points, turn)) < 1e-3
    points[5] += 3.0
    assert apart(written(ctx, own, points), wanted(sums, points)) < 1e-3


def test_moved_points_add_their_differences_and_nothing_accumulates(
    ctx: moderngl.Context, sums: Any, differences: ModuleType
) -> None:
    random = np.random.default_rng(2)
    own = differences.KeptSums(ctx, sums)
    points = random.normal(scale=80.0, size=(POINTS, 3)).astype(np.float32)
    own.update(points, STILL)
    assert own.last == "whole"
    ways = []
    for k in range(3 * differences.MOST_DIFFERENCES):
        some = random.choice(POINTS, random.integers(1, 150), replace=False)
        points[some] += random.normal(scale=5.0, size=(len(some), 3)).astype(np.float32)
        own.update(points, STILL)
        ways.append(own.last)
        if k % 31 == 30:
            assert apart(written(ctx, own, points), wanted(sums, points)) < 2e-3
    assert ways.count("whole") == 2, "every 65th update sums everything"


def test_much_motion_sums_everything(ctx: moderngl.Context, sums: Any, differences: ModuleType) -> None:
    own = differences.KeptSums(ctx, sums)
    points = np.ones((POINTS, 3), np.float32)
    own.update(points, STILL)
    own.update(points, STILL)
    assert own.last == "difference", "nothing moved"
    points[: POINTS * 2 // 3] += 1.0
    own.update(points, STILL)
    assert own.last == "whole"
    assert apart(written(ctx, own, points), wanted(sums, points)) < 1e-4


def test_more_entries_than_floats_count_are_refused(
    ctx: moderngl.Context, sums: Any, differences: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(differences, "MOST_EXACT", len(sums.ids))
    with pytest.raises(ValueError, match=f"{len(sums.ids)} entries"):
        differences.KeptSums(ctx, sums)


@pytest.mark.usefixtures("differences")  # which the benchmark imports
def test_the_sheet_of_the_benchmark_is_a_bicubic_spline(benchmark: Callable[[str], ModuleType]) -> None:
    """Its sums and slopes, against scipy's."""
    sheet = benchmark("gpu_update").sheet(1600)
    net = round(sheet.points**0.5)
    points = np.random.default_rng(4).normal(size=(net, net))
    found = np.zeros((len(sheet.share), 3))
    vertex = np.repeat(np.arange(len(sheet.share)), np.diff(sheet.start))
    np.add.at(found, vertex, sheet.weights * points.ravel()[sheet.ids, None])
    t = np.linspace(0.0, net - 3.0, 40, endpoint=False)
    spline = NdBSpline((np.arange(net + 4.0) - 3.0,) * 2, points, 3)
    at = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1).reshape(-1, 2)
    wanted = [spline(at, nu=way) for way in ((0, 0), (1, 0), (0, 1))]
    assert found == pytest.approx(np.stack(wanted, axis=1), abs=1e-12)
