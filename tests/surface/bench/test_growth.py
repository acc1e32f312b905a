"""Growth is measured for every size, and drawn; figures themselves are never tested."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from surface.bench.growth import Series, growth, plot, slopes


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
