"""The benchmark measures what it says and keeps its ratios consistent; figures themselves are never tested."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.paths import find_config
from controller.tools import bench_surface
from controller.tools.bench_surface import (
    bench_crowd,
    bench_drift,
    bench_growth,
    bench_head,
    bench_large,
    bench_quadtree,
    bench_savings,
    pose_rows,
    poser,
)
from surface.bench.comparison import Variant
from surface.bench.drift import Drift
from surface.bench.savings import MEASURES, Saving
from surface.head import Head
from surface.head.model.file import save_data
from tests.surface.small_head import part, small_head


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder with a head whose face is one small patch."""
    folder = tmp_path_factory.mktemp("head")
    save_data(folder, small_head(parts=[part("face", -40)], seams=[], paint=[]))
    return str(folder)


@pytest.mark.slow
def test_the_head_tables_hold_full_and_incremental_updates() -> None:
    told: list[str] = []
    tables = bench_head("ict", 0.0, told.append)
    (_, poses), (_, engine) = tables
    whole = poses[0]
    assert whole.name == "pose, every parameter changed"
    for row in poses[1:]:
        assert row.ratio == pytest.approx(row.milliseconds / whole.milliseconds)
    names = " ".join(row.name for row in engine)
    for wanted in ("all positions", "one point moved", "reaches", "scipy CSR", "blendshapes"):
        assert wanted in names
    assert all(row.milliseconds > 0 for row in [*poses, *engine])
    assert told


@pytest.mark.slow
def test_the_titles_count_the_head_and_its_largest_part(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([10.0, 10.25])
    monkeypatch.setattr(bench_surface.time, "perf_counter", lambda: next(times))
    monkeypatch.setattr(bench_surface, "measure", lambda *_, **__: [])
    monkeypatch.setattr(bench_surface, "pose_rows", lambda *_: [])
    (about_head, _), (about_part, _) = bench_head("ict", 0.0, lambda text: None)
    head = Head.load(find_config("heads", "ict"))
    assert about_head.startswith(f"head ict: {len(head.parts)} parts, {sum(len(p.vertices) for p in head.parts)} ver")
    assert about_head.endswith("loaded in 250 ms")
    largest = max(head.parts, key=lambda part: part.surface.n)
    assert about_part.startswith(f"{largest.name}: {largest.surface.n} control points, {len(largest.mesh.vertices)} ")


def test_poses_change_everything_one_parameter_or_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    head, posed = Head.load(find_config("heads", "ict")), list[np.ndarray]()
    times = iter([2.0, 1.0, 0.5, 0.25, 0.125])

    def take_all(call: Any, seconds: float) -> float:
        for _ in range(16):  # twice round
            call()
        return next(times)

    monkeypatch.setattr(bench_surface, "least", take_all)
    monkeypatch.setattr(head, "pose", lambda values: posed.append(values.copy()))
    rows = pose_rows(head, 0.0, lambda text: None)
    assert [row.ratio for row in rows] == [None, 0.5, 0.25, 0.125, 0.0625]
    whole, *single, still = np.split(np.array(posed), 5)
    assert whole.min() >= 0.0 and 0.4 < whole.max() <= 0.5 and (np.ptp(whole, axis=0) > 0.0).all()
    for poses, name in zip(single, ("jawOpen", "eyeBlinkLeft", "browInnerUp"), strict=True):
        moving = head.parameters.index(name)
        np.testing.assert_array_equal(poses[:, moving], np.tile(np.arange(8) / 8, 2))
        assert not np.delete(poses, moving, axis=1).any()
    assert not still.any()


def test_a_poser_goes_round_its_poses(monkeypatch: pytest.MonkeyPatch, small: str) -> None:
    head, posed = Head.load(Path(small)), list[float]()
    monkeypatch.setattr(head, "pose", lambda values: posed.append(float(values[0])))
    call = poser(head, np.array([[0.0], [0.5]]))
    for _ in range(3):
        call()
    assert posed == [0.0, 0.5, 0.0]


@pytest.mark.parametrize(("vertices", "level"), [(100_000, 7), (1_000_000, 9), (1_000, 4), (1, 0)])
def test_the_large_tables_are_ten_times_larger(monkeypatch: pytest.MonkeyPatch, vertices: int, level: int) -> None:
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(bench_surface, "build_table", lambda points, deep, _: asked.append((points, deep)) or ["tree"])
    monkeypatch.setattr(bench_surface, "large_table", lambda count, seconds, _: asked.append((count, seconds)) or ["x"])
    monkeypatch.setattr(bench_surface, "sheet", lambda count: f"sheet of {count}")
    monkeypatch.setattr(bench_surface.cold, "cold_rows", lambda *given, report: asked.append(given) or ["cool"])
    (cool, built) = bench_large(0.5, lambda text: None, lambda *_: None, vertices)
    name, title = f"sheet of {10 * vertices:,}", f"about {10 * vertices:,} vertices"
    assert asked == [(vertices, level), (name, [f"sheet of {10 * vertices}"], 0.5, "<= 0.8"), (10 * vertices, 0.5)]
    assert cool == (f"{title}, caches cold", ["cool"]) and built == (title, ["tree", "x"])


def test_growth_scales_its_sizes_down_to_a_least(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[tuple[tuple[int, ...], tuple[int, ...]]] = []
    monkeypatch.setattr(bench_surface.growth, "growth", lambda sizes, points, *_: asked.append((sizes, points)) or [])
    monkeypatch.setattr(bench_surface.growth, "plot", lambda series, out: out.write_text("drawn"))
    titles = []
    for vertices in (100_000, 50_000, 1_000):
        ((title, _),) = bench_growth(0.1, lambda text: None, tmp_path / "a.svg", vertices)
        titles.append(title)
    assert asked == [
        ((10_000, 30_000, 100_000, 300_000, 1_000_000), (100, 1_000, 10_000, 100_000)),
        ((5_000, 15_000, 50_000, 150_000, 500_000), (50, 500, 5_000, 50_000)),
        ((256, 300, 1_000, 3_000, 10_000), (25, 25, 100, 1_000)),
    ]
    assert titles[1] == "growth, from 5,000 to 500,000 vertices and from 50 to 50,000 control points"
    assert title == "growth, from 256 to 10,000 vertices and from 25 to 1,000 control points"
    assert (tmp_path / "a.svg").read_text() == "drawn"


def test_a_crowd_is_measured_beside_one_head(small: str) -> None:
    ((title, (alone, each, tick, memory)),) = bench_crowd(small, 3, 0.0, lambda text: None)
    assert title.startswith("3 heads like ") and alone.milliseconds > 0.0
    assert each.ratio == pytest.approx(each.milliseconds / alone.milliseconds)
    assert tick.ratio == pytest.approx(tick.milliseconds / each.milliseconds) and tick.milliseconds > 0.0
    assert memory.ratio is not None and memory.ratio > 1.0 and memory.reach == "<= 3"


def test_drift_is_told_in_millionths(monkeypatch: pytest.MonkeyPatch, small: str) -> None:
    monkeypatch.setattr(bench_surface, "drift", lambda *_, **__: Drift(10, 4, 2, 1, 3e-6, 5e-6))
    ((title, (place, normal)),) = bench_drift(small, 17, lambda text: None)
    assert title.endswith("after 10 moves of one point, 4 of a group, 2 changes of a weight and 1 of knots")
    assert (place.milliseconds, place.reach, normal.milliseconds, normal.reach) == (0.0, "<= 1", 0.0, "")
    assert place.ratio == pytest.approx(3.0) and normal.ratio == pytest.approx(5.0)


def test_savings_are_told_least_first_on_the_face_and_nine_surfaces(
    monkeypatch: pytest.MonkeyPatch, small: str
) -> None:
    def savings(subjects: Any, level: int, report: Any) -> list[Saving]:
        assert len(subjects) == 10 and subjects[-1][0] == f"face of {small}" and level == 5
        return [Saving(n, m, 0.25, c) for m in MEASURES for n, c in (("b", float("nan")), ("a", 0.5))]

    monkeypatch.setattr(bench_surface, "savings", savings)
    (title, rows), (other, again) = bench_savings(small, lambda text: None)
    assert title == "quad trees on ten surfaces, at equal deviation of 99 % of the area" and other.endswith("equal RMS")
    expected = [("b: by control points", 0.25), ("a: by control points", 0.25), ("a: by chord error", 0.5)]
    assert [(row.name, row.ratio) for row in rows] == [(row.name, row.ratio) for row in again] == expected


def test_quad_trees_tell_their_size_deviation_and_saving(monkeypatch: pytest.MonkeyPatch, small: str) -> None:
    mesh = Head.load(Path(small)).part("face").mesh
    asked: list[tuple[int, float]] = []

    def compare(face: Any, domain: Any, *, level: int, quantile: float, report: Any) -> list[Variant]:
        asked.append((level, quantile))
        names = (("uniform", 0.0), ("by control points", 0.5), ("by chord error", 0.75))
        return [Variant(name, mesh, 0.1234, saving) for name, saving in names]

    monkeypatch.setattr(bench_surface, "compare", compare)
    tables = bench_quadtree(small, lambda text: None)
    assert asked == [(7, 1.0), (7, 0.99)]
    assert [title.rpartition(" at ")[2] for title, _ in tables] == [
        "equal greatest deviation", "equal deviation of 99% of the area"
    ]  # fmt: skip
    for _, (uniform, points, chord) in tables:
        assert uniform.name == f"uniform: {len(mesh.vertices)} vertices, 0.123 mm" and uniform.ratio is None
        assert (uniform.milliseconds, points.milliseconds, points.ratio, chord.ratio) == (0.0, 0.0, 0.5, 0.75)
        assert (points.reach, chord.reach) == (">= 0.502", ">= 0.75")


def test_a_head_and_three_kinds_of_surfaces_are_measured_cold(monkeypatch: pytest.MonkeyPatch) -> None:
    found = list[tuple[Any, ...]]()
    monkeypatch.setattr(bench_surface.cold, "cold_rows", lambda *given, **_: found.append(given) or [])
    monkeypatch.setattr(bench_surface, "speed_table", lambda *_: [])
    assert len(bench_surface.bench_surface(0.1, lambda text: None, 1_000)) == 2
    assert [given[0] for given in found] == ["head ict", "three levels", "scattered points", "sheet"]
    assert [given[2:] for given in found] == [(0.1, "<= 2.0")] * 3 + [(0.1, "<= 1.0")]
    assert len(found[0][1]) == 7 and all(len(given[1]) == 1 for given in found[1:])
