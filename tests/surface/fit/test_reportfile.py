"""The report of a fit: figures, tables, pictures, and the uniform net beside it."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fewer_points import fewer_points
from slit_sheet import slit_sheet
from small_head import small_head

from surface.base.error_colours import SCALE
from surface.base.errors import FitError, ViewError
from surface.fit import reportfile
from surface.fit.api import fit_mesh
from surface.fit.eyes.search import MISSING
from surface.fit.points.local import OFF_MM
from surface.fit.points.nurbsnet import UniformNet
from surface.fit.points.report import Errors, FitReport, PartReport, face_bounds, kinds_line
from surface.fit.reportfile import EXCLUDED, _colours, as_markdown, as_table, write_report
from surface.fit.source.load import Loaded
from surface.fit.source.names import map_names
from surface.head import Head
from surface.head.model.parameters import SHAPES

NETS = [UniformNet(100, 0.5), UniformNet(110, 0.9), UniformNet(250, 0.45)]


def report_of(name: str = "Ada", **other: Any) -> FitReport:
    """A face with two shapes, and lashes without any."""
    shapes = {"jawOpen": Errors(0.1, 0.2, 0.35), "cheekPuff": Errors(0.3, 0.4, 0.55)}
    face = PartReport("face", 120, 300, 7, Errors(0.5, 0.75, 1.25), shapes)
    lashes = PartReport("lashes", 9, 20, 0, Errors(0.01, 0.02, 0.03), {})
    fields = {"missing": ("tongueOut", "mouthRight"), "left_out": ("odd", "strange"), "scale": 0.5, **other}
    return FitReport(name, [face, lashes], list(shapes), **fields)


def test_every_figure_of_the_report_is_in_its_table() -> None:
    table = json.loads(json.dumps(as_table(report_of(), NETS)))
    wanted = {"head": "Ada", "scale": 0.5, "control_points": 129, "parameters": ["jawOpen", "cheekPuff"]}
    wanted |= {"missing": ["tongueOut", "mouthRight"], "left_out": ["odd", "strange"], "notes": []}
    assert {key: table[key] for key in wanted} == wanted
    face, lashes = table["parts"]
    assert (face["name"], face["control_points"], face["samples"], face["excluded_samples"]) == ("face", 120, 300, 7)
    assert face["neutral_mm"] == {"rms": 0.5, "p99": 0.75, "max": 1.25}
    assert face["mean_shape_rms_mm"] == pytest.approx(0.2)
    assert face["shapes_mm"]["cheekPuff"] == {"rms": 0.3, "p99": 0.4, "max": 0.55}
    assert lashes["shapes_mm"] == {} and lashes["mean_shape_rms_mm"] == 0.0
    assert (table["nurbs"]["control_points"], table["nurbs"]["rms_mm"]) == (100, 0.5)
    assert table["nurbs"]["uniform_nets"] == [{"points": 110, "rms": 0.9}, {"points": 250, "rms": 0.45}]


def test_every_figure_of_the_report_can_be_read() -> None:
    lines = as_markdown(report_of(notes=["eyes guessed"]), NETS, ["a.png", "b.png"]).splitlines()
    assert lines[0] == "# Ada: 129 control points, 2 shapes"
    for line in (
        "- eyes guessed", "- no shape for: tongueOut, mouthRight", "- left out, not ARKit's: odd, strange",
        "| face | 120 | 300 | 7 | 0.500 | 0.750 | 1.250 | 0.200 |",
        "| lashes | 9 | 20 | 0 | 0.010 | 0.020 | 0.030 | 0.000 |", "![error](a.png)", "![error](b.png)",
        "| this head's | 100 | 0.500 |", "| uniform | 250 | 0.450 |", "## Shapes of face",
        "| jawOpen | 0.100 | 0.200 | 0.350 |", "| cheekPuff | 0.300 | 0.400 | 0.550 |",
    ):  # fmt: skip
        assert lines.count(line) == 1, line
    assert sum("violet" in line for line in lines) == 1 and not any("OpenGL" in line for line in lines)
    assert "## Shapes of lashes" not in lines
    plain = as_markdown(report_of(missing=(), left_out=()), NETS, [])
    assert "no shape for" not in plain and "left out" not in plain
    assert "OpenGL is not available" in plain and "violet" not in plain


def test_a_report_replaces_an_older_one_and_folders_are_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reportfile, "_nets", lambda result: NETS)
    monkeypatch.setattr(reportfile, "_draw", lambda result, folder: [])
    folder = tmp_path / "some" / "where"
    for name in ("Ada", "Bob"):
        write_report(SimpleNamespace(report=report_of(name)), folder, lambda part, done: None)  # type: ignore[arg-type]
        assert json.loads((folder / "report.json").read_text())["head"] == name
        assert (folder / "report.md").read_text().startswith(f"# {name}: ")
        assert sorted(p.name for p in folder.parent.rglob("*")) == ["report.json", "report.md", "where"]


def test_uniform_nets_stand_beside_the_first_tile_without_its_folds(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, float]] = []
    monkeypatch.setattr(reportfile, "uniform_nets", lambda *given: asked.append(given[2:]) or NETS[1:])
    uv = np.array([[0.1, 0], [0.5, 0], [1.0, 0], [0.7, 0], [1.9, 0], [2.5, 0]])  # the last two: another tile
    chart = SimpleNamespace(uv=uv, folded=np.array([False, False, False, True, False, False]))
    net = SimpleNamespace(centres=np.array([[0.1, 0], [0.3, 0], [1.05, 0], [1.9, 0], [2.5, 0]]))
    fitted = SimpleNamespace(net=net, error=np.array([1.0, 2.0, 4.0, 9.0, 7.0, 7.0]))
    nets = reportfile._nets(SimpleNamespace(parts=[SimpleNamespace(chart=chart, fitted=fitted, targets=None)]))
    assert nets == [UniformNet(3, pytest.approx(np.sqrt(7.0))), *NETS[1:]]
    assert asked == [(3, pytest.approx(np.sqrt(7.0)))]


def fitted_part(uv: np.ndarray, folded: np.ndarray, name: str = "a", **errors: np.ndarray) -> Any:
    chart = SimpleNamespace(uv=uv, folded=folded)
    return SimpleNamespace(name=name, chart=chart, fitted=SimpleNamespace(**errors))


def test_colours_are_those_of_the_legend() -> None:
    uv = np.random.default_rng(3).random((40, 2))
    part, errors = fitted_part(uv, np.zeros(40, bool)), (0.0, 0.25, 0.5, 0.75, 1.0, 3.0, 0.125)
    got = [_colours(uv[:5], part, np.full(40, e)) for e in errors]
    for colours, wanted in zip(got, [*SCALE, SCALE[4], SCALE[:2].mean(axis=0)], strict=True):
        np.testing.assert_allclose(colours, np.tile(wanted, (5, 1)), atol=1e-6)
        assert colours.dtype == np.float32
    every = np.vstack([SCALE, EXCLUDED])
    assert (every >= 0.0).all() and (every <= 1.0).all()
    blue, green, yellow, orange, red, violet = every
    assert blue.argmax() == 2 and green.argmax() == 1 and yellow.argmin() == 2 and orange.argmax() == red.argmax() == 0
    assert violet.argmin() == 1 and yellow[1] > 0.5 > orange[1] > red[1]


def test_a_colour_is_the_mean_of_the_four_nearest_samples() -> None:
    uv = np.column_stack([np.arange(6.0), np.zeros(6)])
    error = np.array([0.0, 0.0, 0.0, 1.0, 9.0, 9.0])
    part = fitted_part(uv, np.array([True, True, True, False, True, True]))
    place = np.array([[-1.0, 0.0]])
    assert _colours(place, part, error)[0] == pytest.approx(EXCLUDED, abs=1e-6)
    part.chart.folded[0] = False  # half of them lie inside a fold
    assert _colours(place, part, error)[0] == pytest.approx(SCALE[1], abs=1e-6)
    alone = fitted_part(uv[:1], np.array([False]))
    assert _colours(uv[:2], alone, np.array([0.5])) == pytest.approx(np.tile(SCALE[2], (2, 1)), abs=1e-6)


def test_pictures_show_the_error_at_rest_and_of_the_worst_shape(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uv, drawn = np.random.default_rng(1).random((30, 2)), {}

    def keep(head: Head, path: Path) -> None:
        drawn[path.name] = {part.name: part.attributes["albedo"].copy() for part in head.parts}
        assert all(set(part.attributes) <= {"albedo", "eye_local"} for part in head.parts)

    monkeypatch.setattr(reportfile, "_picture", keep)
    worst = np.stack([np.full(30, 0.25), np.full(30, 1.0)])
    parts = [
        fitted_part(uv, np.zeros(30, bool), "a", error=np.full(30, 0.5), shape_error=worst),
        fitted_part(uv, np.zeros(30, bool), "b", error=np.full(30, 0.75), shape_error=np.zeros((0, 30))),
    ]
    result: Any = SimpleNamespace(head=small_head(), parts=parts)
    assert reportfile._draw(result, tmp_path) == ["error_neutral.png", "error_shapes.png"] == list(drawn)
    for name, (a, b) in {"error_neutral.png": (2, 3), "error_shapes.png": (4, 0)}.items():
        for part, wanted in {"a": SCALE[a], "b": SCALE[b], "tooth": [0.35] * 3}.items():
            albedo = drawn[name][part]
            assert albedo == pytest.approx(np.broadcast_to(wanted, albedo.shape), abs=1e-6), (name, part)

    def refuse(head: Head, path: Path) -> None:
        raise ViewError("no OpenGL", hint="")

    monkeypatch.setattr(reportfile, "_picture", refuse)
    assert reportfile._draw(result, tmp_path) == []


def test_a_picture_has_four_views_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    cameras = []

    class Screen:
        def __init__(self, head: Any, size: tuple[int, int], **other: Any) -> None:
            self.size = size

        def __enter__(self) -> "Screen":
            return self

        def __exit__(self, *error: object) -> None: ...

        def render(self, values: np.ndarray, camera: Any) -> np.ndarray:
            cameras.append(camera)
            return np.zeros((*self.size[::-1], 3), np.uint8)

    monkeypatch.setattr("surface.view.pictures.offscreen.Offscreen", Screen)
    reportfile._picture(Head(small_head()), tmp_path / "it.png")
    assert len({camera.yaw_deg for camera in cameras[:3]}) == 3
    assert cameras[3].pitch_deg == pytest.approx(cameras[0].pitch_deg - 55.0)
    assert cameras[3].yaw_deg == pytest.approx(cameras[0].yaw_deg)
    with image.open(tmp_path / "it.png") as sheet:
        width, height = sheet.size
    assert 4 * 420 <= width < 4 * 440 and 480 <= height < 540


@pytest.fixture(scope="module")
def result():
    mesh = slit_sheet()
    pit = 1200 * np.maximum(0.0, 1 - np.linalg.norm(mesh.uv - [0.3, 0.3], axis=1) / 0.08)
    mesh = replace(mesh, vertices=mesh.vertices - pit[:, None] * [0, 0, 1.0])
    mesh = replace(mesh, names=(*mesh.names, "odd"), deltas=np.concatenate([mesh.deltas, mesh.deltas[:1]]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("surface.fit.source.uvcheck.SQUEEZED_SHARE", 1.0)  # the pit stays squeezed: it is a fold
        patch.setattr("surface.fit.source.owncharts.MAX_UNEVENNESS", np.inf)
        with fewer_points():
            return fit_mesh(Loaded(mesh, map_names(mesh.names), ("unit taken to be mm",)), "sheet", lambda *_: None)


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report"
    heard = []
    write_report(result, path, lambda part, done: heard.append(done))
    assert heard == [0.5, 1.0]
    return path


@pytest.mark.slow
def test_the_figures_are_those_of_the_fit(folder, result):
    table = json.loads((folder / "report.json").read_text())
    assert (table["format"], table["version"]) == ("omote fit report", 1)
    (part,) = table["parts"]
    assert part["control_points"] == result.report.points and set(part["shapes_mm"]) == {"jawOpen", "mouthSmileLeft"}
    assert part["neutral_mm"]["rms"] == result.report.parts[0].neutral.rms
    assert table["left_out"] == ["odd"] and "tongueOut" in table["missing"]
    assert {"unit taken to be mm", MISSING} <= set(table["notes"])
    assert part["excluded_samples"] == int(result.parts[0].chart.folded.sum())
    local = table["localised"]
    assert 0 < local["after"] <= local["before"] and local["off_mm"] <= OFF_MM * table["scale"]
    assert local["after"] == sum(len(g.ids) for p in result.head.parts for g in p.groups if g.name in SHAPES)
    assert any(note.startswith("skin that a shape hardly moves stays: ") for note in table["notes"])


@pytest.mark.slow
def test_pieces_and_shapes_stand_in_it(folder, result):
    table = json.loads((folder / "report.json").read_text())
    assert table["shapes"] == {"jawOpen": ["jawOpen"], "mouthSmileLeft": ["mouthSmile_L"]}
    assert (table["empty"], table["presets"], table["pieces"]) == ([], [], {})
    report = replace(
        result.report, pieces={"Head": "skin", "Hat|1": "hat, left out"}, empty=("odd2",), presets=("Joy",)
    )
    text = as_markdown(report, [UniformNet(9, 0.1), UniformNet(9, 0.2)], [])
    for words in ("| Hat\\|1 | hat, left out |", "| mouthSmileLeft | mouthSmile_L |", "empty: odd2",
                  "presets, made from parameters: Joy"):  # fmt: skip
        assert words in text
    assert kinds_line(report) == "pieces: skin (Head); hat, left out (Hat|1)" and kinds_line(result.report) == ""


@pytest.mark.slow
def test_it_can_be_read(folder):
    text = (folder / "report.md").read_text()
    for words in ("left out, not ARKit's: odd", "| jawOpen |", "uniform cubic NURBS net", "unit taken to be mm"):
        assert words in text


@pytest.mark.parametrize(("scale", "said"), [(0.5, "within"), (0.04, "beyond")])
def test_the_face_stands_beside_bounds_that_grow_with_the_head(scale, said):
    face = PartReport("face", 9, 9, 0, Errors(0.02, 0.05, 0.1), {"jawOpen": Errors(0.003, 0.02, 0.1)})
    line = face_bounds(FitReport("me", [face], [], scale=scale))
    assert line.startswith(f"face: {said} the bounds for its size ({scale:.2f}): RMS 0.020 of {0.25 * scale:.3f} mm")
    assert f"99 % 0.050 of {0.8 * scale:.3f} mm" in line and f"shapes 0.003 of {0.08 * scale:.3f} mm" in line


@pytest.mark.slow
def test_the_error_is_drawn_on_the_face(folder, gl):
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    for name in ("error_neutral.png", "error_shapes.png"):
        assert name in (folder / "report.md").read_text()
        pixels = np.asarray(image.open(folder / name).convert("RGB"), int)
        assert pixels.shape[1] > 1600 and (np.ptp(pixels, axis=2) > 30).mean() > 0.05


@pytest.mark.slow
def test_excluded_places_have_a_colour_of_their_own(result):
    part = result.parts[0]
    assert part.chart.folded.any()
    colours = _colours(part.chart.uv, part, part.fitted.error)
    violet = (np.abs(colours - EXCLUDED) < 1e-6).all(axis=1)
    assert violet.any() and (part.chart.folded[violet].mean() > 0.5)


@pytest.mark.slow
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
