"""The report of a fit: figures, tables, pictures, and the uniform net beside it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit import reportfile
from surface.fit.api import fit_mesh
from surface.fit.points.nurbsnet import UniformNet
from surface.fit.points.report import Errors, FitReport, PartReport, face_bounds
from surface.fit.reportfile import EXCLUDED, _colours, write_report
from surface.fit.source.load import Loaded
from surface.fit.source.names import map_names


@pytest.fixture(scope="module")
def result():
    mesh = slit_sheet()
    pit = 1200 * np.maximum(0.0, 1 - np.linalg.norm(mesh.uv - [0.3, 0.3], axis=1) / 0.08)
    mesh = replace(mesh, vertices=mesh.vertices - pit[:, None] * [0, 0, 1.0])
    mesh = replace(mesh, names=(*mesh.names, "odd"), deltas=np.concatenate([mesh.deltas, mesh.deltas[:1]]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("surface.fit.source.uvcheck.SQUEEZED_SHARE", 1.0)  # the pit stays squeezed: it is a fold
        return fit_mesh(Loaded(mesh, map_names(mesh.names), ("unit taken for mm",)), "sheet", lambda part, done: None)


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report"
    heard = []
    write_report(result, path, lambda part, done: heard.append(done))
    assert heard == [0.5, 1.0]
    return path


def test_the_figures_are_those_of_the_fit(folder, result):
    table = json.loads((folder / "report.json").read_text())
    assert (table["format"], table["version"]) == ("omote fit report", 1)
    (part,) = table["parts"]
    assert part["control_points"] == result.report.points and set(part["shapes_mm"]) == {"jawOpen", "mouthSmileLeft"}
    assert part["neutral_mm"]["rms"] == result.report.parts[0].neutral.rms
    assert table["left_out"] == ["odd"] and "tongueOut" in table["missing"] and table["notes"] == ["unit taken for mm"]
    assert part["excluded_samples"] == int(result.parts[0].chart.folded.sum())


def test_it_can_be_read(folder):
    text = (folder / "report.md").read_text()
    for words in ("left out, not ARKit's: odd", "| jawOpen |", "uniform cubic NURBS net", "unit taken for mm"):
        assert words in text


@pytest.mark.parametrize(("scale", "said"), [(0.5, "within"), (0.04, "beyond")])
def test_the_face_stands_beside_bounds_that_grow_with_the_head(scale, said):
    face = PartReport("face", 9, 9, 0, Errors(0.02, 0.05, 0.1), {"jawOpen": Errors(0.003, 0.02, 0.1)})
    line = face_bounds(FitReport("me", [face], [], scale=scale))
    assert line.startswith(f"face: {said} the bounds for its size ({scale:.2f}): RMS 0.020 of {0.25 * scale:.3f} mm")
    assert f"99 % 0.050 of {0.8 * scale:.3f} mm" in line and f"shapes 0.003 of {0.08 * scale:.3f} mm" in line


def test_the_error_is_drawn_on_the_face(folder, gl):
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    for name in ("error_neutral.png", "error_shapes.png"):
        assert name in (folder / "report.md").read_text()
        pixels = np.asarray(image.open(folder / name).convert("RGB"), int)
        assert pixels.shape[1] > 1600 and (np.ptp(pixels, axis=2) > 30).mean() > 0.05


def test_excluded_places_have_a_colour_of_their_own(result):
    part = result.parts[0]
    assert part.chart.folded.any()
    colours = _colours(part.chart.uv, part, part.fitted.error)
    violet = (np.abs(colours - EXCLUDED) < 1e-6).all(axis=1)
    assert violet.any() and (part.chart.folded[violet].mean() > 0.5)


def test_nothing_is_left_where_it_cannot_be_written(result, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FitError, match="the report cannot be written"):
        write_report(result, tmp_path / "file", lambda part, done: None)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_the_verdict_on_uniform_nets_is_the_first_that_is_as_good() -> None:
    def lines(*nets: tuple[int, float]) -> list[str]:
        return reportfile._net_lines([UniformNet(points, rms) for points, rms in nets])

    good = lines((100, 0.5), (110, 0.9), (250, 0.5), (400, 0.3))
    assert good[2:6] == ["| this head's | 100 | 0.500 |", "| uniform | 110 | 0.900 |", "| uniform | 250 | 0.500 |",
                         "| uniform | 400 | 0.300 |"]  # fmt: skip
    assert good[-1] == "As good a uniform net needs 2.5 times the points."
    assert lines((100, 0.5), (110, 0.9), (430, 0.51))[-1] == "With 4.3 times the points it is still not as good."
