"""Growth is measured for every size, and drawn; figures themselves are never tested."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from surface import DCPSurface, Mesh
from surface.bench import growth as grow
from surface.bench.bench import bumpy, sheet
from surface.bench.growth import (
    FULL,
    LISTS,
    MEMORY,
    MOVE,
    READ,
    Series,
    _measure_amounts,
    _spread,
    growth,
    plot,
    slopes,
)


def test_series_and_plot_are_complete(tmp_path: Path) -> None:
    reported: list[str] = []
    series = growth((1_000, 4_000), (64, 900), 0.001, reported.append)
    assert len(reported) == 4
    assert len(series) == 10
    for line in series:
        assert len(line.size) == len(line.amount) == 2
        assert line.size[0] < line.size[1]
        assert min(line.amount) > 0
    plot(series, tmp_path / "growth.svg")
    root = ElementTree.parse(tmp_path / "growth.svg").getroot()
    words = " ".join(text.text or "" for text in root.iter("{http://www.w3.org/2000/svg}text"))
    for line in series:
        assert f"{line.name}, slope {line.slope:.2f}" in words
    rows = slopes(series)
    assert [row.ratio for row in rows] == [line.slope for line in series]


def test_a_slope_is_the_exponent() -> None:
    line = Series("x", 0, [10, 100, 1000], (3 * np.array([10.0, 100, 1000]) ** 1.5).tolist())
    assert line.slope == pytest.approx(1.5)


SVG = "{http://www.w3.org/2000/svg}"


def drawn(
    series: list[Series], path: Path
) -> tuple[ElementTree.Element, list[dict[str, float]], list[ElementTree.Element]]:
    """The picture; where each panel has its powers of ten, as x of "x1e2" and y of "y1e-1"; its texts."""
    plot(series, path)
    root = ElementTree.parse(path).getroot()
    texts = list(root.iter(f"{SVG}text"))
    ticks: list[dict[str, float]] = [{}, {}]
    for text in texts:
        if (text.text or "").startswith("1e"):
            x, y = float(text.get("x", 0)), float(text.get("y", 0))
            below = text.get("text-anchor") == "middle"
            ticks[int(x > 600)]["xy"[not below] + str(text.text)] = x if below else y - 4
    return root, ticks, texts


def numbers(path: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+\.?\d*", path)]


def power_laws() -> list[Series]:
    """Five lines for each panel, as :func:`growth` makes them."""
    large, few = [100, 1000, 100000], [31, 9000]
    exponents = {"flat": 0.0, "steep": 1.0, "near": 0.001, "down": -0.5, "root": 0.5}
    first = [Series(name, 0, large, [(x / 1000) ** e for x in large]) for name, e in exponents.items()]
    return first + [Series(f"{name} too", 1, few, [0.03 * x**e for x in few]) for name, e in exponents.items()]


def test_lines_run_through_their_places_on_logarithmic_scales(tmp_path: Path) -> None:
    series = power_laws()
    root, ticks, texts = drawn(series, tmp_path / "plot.svg")
    upward = ["y1e-4", "y1e-3", "y1e-2", "y1e-1", "y1e0", "y1e1", "y1e2", "y1e3"]
    assert [sorted(t, key=lambda k: (k[0], int(k[3:]))) for t in ticks] == [
        ["x1e2", "x1e3", "x1e4", "x1e5", *upward],
        ["x1e1", "x1e2", "x1e3", "x1e4", *upward],
    ]
    for panel in ticks:  # both are 400 by 420
        across = [x for key, x in panel.items() if key[0] == "x"]
        upward = [y for key, y in panel.items() if key[0] == "y"]
        assert max(across) - min(across) == pytest.approx(400, abs=0.2)
        assert max(upward) - min(upward) == pytest.approx(420, abs=0.2) and panel["y1e3"] == pytest.approx(50)
    assert (ticks[0]["x1e2"], ticks[1]["x1e1"]) == (pytest.approx(70), pytest.approx(70 + 400 + 250))
    lines = [path for path in root.iter(f"{SVG}path") if path.get("fill") == "none"]
    assert len(lines) == 10 and len({path.get("stroke") for path in lines[:5]}) == 5
    for line, path in zip(series, lines, strict=True):
        panel = ticks[line.axis]
        low = 2 if line.axis == 0 else 1
        wide = panel[f"x1e{low + 1}"] - panel[f"x1e{low}"]
        x = panel[f"x1e{low}"] + (np.log10(line.size) - low) * wide
        y = panel["y1e0"] - np.log10(line.amount) * (panel["y1e0"] - panel["y1e1"])
        np.testing.assert_allclose(numbers(path.get("d", "")), np.column_stack([x, y]).ravel(), atol=0.2)
        label = next(text for text in texts if (text.text or "") == f"{line.name}, slope {line.slope:.2f}")
        assert label.get("fill") == path.get("stroke")
        assert float(label.get("x", 0)) == pytest.approx(x[-1] + 8, abs=0.2)


def test_the_grid_stands_where_its_numbers_stand(tmp_path: Path) -> None:
    root, ticks, texts = drawn(power_laws(), tmp_path / "plot.svg")
    grid = [path.get("d", "") for path in root.iter(f"{SVG}path") if path.get("fill") is None]
    upright = [numbers(d) for d in grid if "V" in d]
    level = [numbers(d) for d in grid if "H" in d]
    assert len(upright) == 8 and len(level) == 16
    for panel, left in zip(ticks, (70, 720), strict=True):
        own = [line for line in upright if left - 1 < line[0] < left + 401]
        assert [x for x, *_ in own] == [x for key, x in panel.items() if key[0] == "x"]
        assert all((top, bottom) == (50, 470) for _, top, bottom in own)
        own = [line for line in level if left - 1 < line[0] < left + 401]
        np.testing.assert_allclose([y for _, y, _ in own], [y for key, y in panel.items() if key[0] == "y"], atol=0.11)
        assert all((start, end) == (left, left + 400) for start, _, end in own)
    below = [float(t.get("y", 0)) for t in texts if t.get("text-anchor") == "middle" and t.get("font-size") is None]
    beside = [float(t.get("x", 0)) for t in texts if t.get("text-anchor") == "end"]
    assert set(below) == {470 + 18} and set(beside) == {70 - 8, 720 - 8}
    titles = {t.text: (float(t.get("x", 0)), float(t.get("y", 0))) for t in texts if t.get("font-size") == "14"}
    assert titles == {"vertices": (270.0, 510.0), "control points": (920.0, 510.0)}
    assert (root.get("width"), root.get("height")) == ("1370", "540")  # room for numbers, titles and labels


def test_sizes_that_are_nearly_powers_of_ten_end_their_axis(tmp_path: Path) -> None:
    """A mesh has seldom exactly as many vertices as asked for."""
    for sizes, wanted in (([90, 1100], {"x1e2", "x1e3"}), ([70, 1400], {"x1e1", "x1e2", "x1e3", "x1e4"})):
        series = [Series("a", axis, sizes, [1.0, 20.0]) for axis in (0, 1) for _ in range(5)]
        ticks = drawn(series, tmp_path / "plot.svg")[1]
        assert {key for key in ticks[0] if key[0] == "x"} == wanted


def test_labels_keep_apart_and_in_order() -> None:
    heights = [100.0, 40.0, 42.0, 41.0, 300.0]
    placed = _spread(heights)
    assert placed == [100.0, 40.0, 70.0, 55.0, 300.0]
    assert _spread([7.0, 7.0], 3.0) == [7.0, 10.0] and _spread([]) == []


def test_each_size_is_measured_with_cells_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int, float]] = []

    def amounts(surface: DCPSurface, leaves: int, seconds: float) -> dict[str, float]:
        asked.append((surface.n, leaves, seconds))
        return dict.fromkeys((READ, FULL, MOVE, LISTS, MEMORY), float(len(asked)))

    monkeypatch.setattr(grow, "_measure_amounts", amounts)
    reported: list[str] = []
    series = growth((1_000, 10_000), (64, 900, 2500), 0.25, reported.append)
    meshes = [sheet(count) for count in (1_000, 10_000)]
    assert asked[:2] == [(surface.n, mesh.leaves, 0.25) for surface, mesh in meshes]
    assert asked[2:] == [(n, 50 * 50, 0.25) for n in (64, 900, 2500)]  # a quarter of 10,000 cells
    assert reported == [f"growth: {n} vertices" for n in (1_000, 10_000)] + [
        f"growth: {n} control points" for n in (64, 900, 2500)
    ]
    names = (READ, FULL, MOVE, LISTS, MEMORY)
    assert [(line.name, line.axis) for line in series] == [(name, axis) for axis in (0, 1) for name in names]
    for line in series:
        assert line.size == ([64, 900, 2500] if line.axis else [len(mesh.vertices) for _, mesh in meshes])
        assert line.amount == ([3.0, 4.0, 5.0] if line.axis else [1.0, 2.0])
    asked.clear()
    growth((100,), (64,), 0.1)
    assert asked[1][1] == 16 * 16  # no fewer cells than that


def test_a_surface_is_measured_with_as_many_equal_cells_as_said() -> None:
    made: list[Mesh] = []
    surface = bumpy(100)
    tessellate = DCPSurface.tessellate

    def record(self: DCPSurface, **given: Any) -> Mesh:
        made.append(tessellate(self, **given))
        return made[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DCPSurface, "tessellate", record)
        for side in (8, 12, 9):
            found = _measure_amounts(surface, side * side, 0.0)
            mesh = made.pop()
            assert mesh.leaves == side * side and len(mesh.vertices) == (side + 1) ** 2
            deformation = surface.deformation(mesh, normals=False)
            assert found[MEMORY] == pytest.approx(deformation.nbytes / 1e6)
            assert min(found.values()) > 0 and set(found) == {READ, FULL, MOVE, LISTS, MEMORY}


def test_rows_name_the_range_and_the_bound_of_their_slope() -> None:
    line = Series(FULL, 0, [10, 100, 1000], [1.0, 20.0, 123.4])
    other = Series(FULL, 1, [10, 100], [1.0, 20.0])
    first, second = slopes([line, other])
    assert first.name == f"{FULL}: 1 to 123" and first.milliseconds == 0.0
    assert (first.against, first.reach) == ("slope in vertices", "0.9 to 1.1")
    assert (second.against, second.reach) == ("slope in control points", "")
    (still,) = slopes([Series(MOVE, 0, [10, 100], [1.0, 1.0])])
    assert still.reach == "-0.1 to 0.1" and still.kept is True
