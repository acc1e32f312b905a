"""surface.fit.points.report: errors outside folds, and bounds that grow with the head."""

from dataclasses import replace

import numpy as np
import pytest

from surface.fit.points.net import Net
from surface.fit.points.refine import Fitted
from surface.fit.points.report import (
    P99_MM,
    RMS_MM,
    SHAPES_MM,
    DenseErrors,
    Errors,
    FitReport,
    PartReport,
    Spot,
    face_bounds,
    kinds_line,
    measure,
    plain,
)
from surface.fit.source.chart import Chart


def fitted(error: np.ndarray, shapes: np.ndarray) -> Fitted:
    net = Net(np.zeros((7, 4), np.int64), np.zeros((7, 5)), np.zeros((7, 5)))
    return Fitted(net, np.zeros((7, 3)), np.zeros((len(shapes), 7, 3)), error, shapes)


def chart(folded: np.ndarray) -> Chart:
    n = len(folded)
    return Chart(np.zeros((n, 2)), None, np.ones(n), np.ones((n, 2)), folded, [], [])


def test_errors_are_measured_outside_folds():
    error = np.array([3.0, 4.0, 100.0, 0.0])
    shapes = np.array([[1.0, 1.0, 50.0, 1.0], [0.0, 0.0, 50.0, 6.0]])
    report = measure("face", chart(np.array([False, False, True, False])), fitted(error, shapes), ("a", "b"))
    assert (report.name, report.points, report.samples, report.folded) == ("face", 7, 3, 1)
    assert report.neutral == Errors(pytest.approx(np.sqrt(25 / 3)), pytest.approx(3.98), 4.0)
    assert report.shapes["a"] == Errors(1.0, 1.0, 1.0)
    assert report.shapes["b"] == Errors(pytest.approx(np.sqrt(12.0)), pytest.approx(5.88), 6.0)
    assert report.mean_shape_rms == pytest.approx((1.0 + np.sqrt(12.0)) / 2)


def test_a_part_without_samples_was_not_measured():
    """0 would read as a perfect fit."""
    report = measure("tooth", chart(np.array([True])), fitted(np.array([5.0]), np.zeros((0, 1))), ())
    assert not report.neutral.measured and report.neutral.figures() == ["-", "-", "-"]
    assert report.shapes == {} and report.mean_shape_rms == 0.0
    shown = measure("tooth", chart(np.array([True])), fitted(np.array([5.0]), np.ones((1, 1))), ("jawOpen",))
    assert not shown.shapes["jawOpen"].measured and np.isnan(shown.mean_shape_rms)
    assert face_bounds(FitReport("h", [report], [])) == "tooth: not measured: there are no samples of it"
    assert plain({"a": [report.neutral.max, 1.0], "b": (2.0,)}) == {"a": [None, 1.0], "b": [2.0]}


def face(rms: float, p99: float, shape: float | None) -> FitReport:
    shapes = {} if shape is None else {"jawOpen": Errors(shape, 1.0, 1.0)}
    part = PartReport("face", 5, 1, 0, Errors(rms, p99, 1.0), shapes)
    return FitReport("h", [part, replace(part, points=8, neutral=Errors(9.0, 9.0, 9.0))], [])


@pytest.mark.parametrize(
    ("count", "said"), [(1, ""), (4, "pieces: skin (a, b, c, d)"), (5, "pieces: skin (a, b, c, d, ...)")]
)
def test_four_pieces_of_a_kind_are_named(count, said):
    report = FitReport("head", [], [], pieces=dict.fromkeys("abcdef"[:count], "skin"))
    assert kinds_line(report) == said


def test_the_bounds_of_a_face():
    assert (RMS_MM, P99_MM, SHAPES_MM) == (0.25, 0.8, 0.08)


def test_the_points_of_all_parts_are_counted():
    assert face(0, 0, 0).points == 13


@pytest.mark.parametrize(
    ("report", "verdict"),
    [
        (face(RMS_MM, P99_MM, SHAPES_MM), "within"), (face(RMS_MM + 1e-9, P99_MM, SHAPES_MM), "beyond"),
        (face(RMS_MM, P99_MM + 1e-9, SHAPES_MM), "beyond"), (face(RMS_MM, P99_MM, SHAPES_MM + 1e-9), "beyond"),
        (face(RMS_MM, P99_MM, None), "within"), (replace(face(0.5, 1.6, 0.16), scale=2.0), "within"),
        (replace(face(0.2, 0.7, 0.07), scale=0.5), "beyond"),
    ],
)  # fmt: skip
def test_the_face_is_held_to_bounds_that_grow_with_the_head(report, verdict):
    text = face_bounds(report)
    assert text.startswith(f"face: {verdict} the bounds for its size ({report.scale:.2f}): RMS ")
    assert ("shapes" in text) == bool(report.parts[0].shapes)
    assert f"{report.parts[0].neutral.p99:.3f} of {0.8 * report.scale:.3f} mm" in text


def coarse(rms: float, p99: float, share: float) -> FitReport:
    """A face beyond its bounds as a whole, with its errors where the mesh has the detail."""
    report = face(2.0 * RMS_MM, 2.0 * P99_MM, SHAPES_MM)
    return replace(report, parts=[replace(report.parts[0], detailed=Errors(rms, p99, 1.0), share=share)])


@pytest.mark.parametrize(
    ("report", "verdict"),
    [
        (coarse(RMS_MM, P99_MM, 0.8), "within the bounds where the mesh has the detail,"),
        (coarse(RMS_MM, P99_MM + 1e-9, 0.8), "beyond the bounds"), (coarse(RMS_MM, P99_MM, 0.4), "beyond the bounds"),
    ],
)  # fmt: skip
def test_a_coarse_mesh_is_held_to_the_bounds_where_it_has_the_detail(report, verdict):
    text = face_bounds(report)
    assert text.startswith(f"face: {verdict} for its size (1.00): RMS 0.500 of 0.250 mm, 99 % 1.600 of 0.800 mm")
    assert ("; where the mesh has the detail (80% of it) RMS 0.250" in text) == (report.parts[0].share > 0.5)


def test_errors_are_also_measured_where_samples_are_fine():
    error, folded = np.array([3.0, 4.0, 100.0, 1.0]), np.array([False, False, True, False])
    fine = np.array([True, False, True, True])
    report = measure("face", chart(folded), fitted(error, np.zeros((0, 4))), (), fine)
    assert report.neutral.max == 4.0 and report.detailed == Errors(
        pytest.approx(np.sqrt(5.0)), pytest.approx(2.98), 3.0
    )
    assert report.share == pytest.approx(2 / 3)


def spot(mm: float, shape: str = "jawOpen", *, to_mesh: bool = True) -> Spot:
    return Spot(mm, shape, "face", "at the chin", to_mesh)


def test_the_greatest_error_is_said_with_its_way():
    assert str(spot(1.234)) == "1.23 mm: shape jawOpen, at the chin (face, surface to mesh)"
    assert str(spot(0.5, "neutral", to_mesh=False)) == "0.50 mm: the neutral face, at the chin (face, mesh to surface)"


def test_errors_are_told_line_by_line():
    dense = DenseErrors({}, spot(2.0), None, (), (), 1)
    assert dense.lines() == [f"greatest error {spot(2.0)}"]
    assert DenseErrors({}, None, None, (), (), 1, apart=spot(1.0)).lines() == []
    assert DenseErrors({}, None, None, (), (), 1).greatest is None
    for apart, said in ((1.9, 2), (2.0, 1), (2.1, 1)):
        both = replace(dense, apart=spot(apart))
        assert len(both.lines()) == said and both.greatest.mm == min(apart, 2.0)
    full = DenseErrors({}, spot(2.0), spot(3.0), ("a", "b"), ("c", "d"), 1, corrected=("e", "f"), apart=spot(1.0))
    assert full.lines() == [
        f"greatest error {spot(1.0)}",
        f"with contacts, which move lips, lids and tongue out of each other, away from the mesh: {spot(2.0)}",
        f"in folds (nostrils, ear canals, corners), which are held only loosely: {spot(3.0)}",
        "changed on purpose by correctives and the tongue's rules, and measured without them: e, f",
        "not in the mesh, so not measured: a, b",
        "faces of the mesh that no fitted part holds: c, d",
    ]


def test_figures_have_three_digits():
    assert Errors(0.12345, 1.0, 22.7).figures() == ["0.123", "1.000", "22.700"]


def test_detail_is_measured_on_the_samples_that_are_fine():
    error, folded = np.array([3.0, 4.0, 100.0, 0.0]), np.array([False, False, True, False])
    fine = np.array([True, False, True, False])
    report = measure("face", chart(folded), fitted(error, np.zeros((0, 4))), (), fine)
    assert report.detailed == Errors(3.0, 3.0, 3.0) and report.share == pytest.approx(1 / 3)
    assert measure("face", chart(folded), fitted(error, np.zeros((0, 4))), ()).share == 1.0
    nothing = measure("face", chart(folded | True), fitted(error, np.zeros((0, 4))), (), fine)
    assert not nothing.detailed.measured and nothing.share == 0.0
