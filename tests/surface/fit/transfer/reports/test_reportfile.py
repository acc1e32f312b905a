"""The files of a transfer's report: table, text, the view of the face, distances of the scan, all or nothing."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from surface.base.errors import FitError
from surface.fit.points.report import Errors, FitReport, PartReport
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.reports import distances
from surface.fit.transfer.reports import reportfile as module
from surface.fit.transfer.reports.gaps import Gap
from surface.fit.transfer.reports.report import Found, TransferReport
from surface.fit.transfer.reports.reportfile import as_markdown, as_table, view_of, write_transfer_report
from surface.fit.transfer.scan import make_scan

HERE = Similarity(np.eye(3), 1.0, np.zeros(3))


def report(name: str = "mia", **other: Any) -> TransferReport:
    face = PartReport("face", 900, 5000, 0, Errors(0.2, 0.7, 1.5), {"jawOpen": Errors(0.01, 0.02, 0.03)})
    fit = FitReport(name, [face], ["jawOpen", "cheekPuff"], notes=["guessed the unit"])
    fields = {
        "source": "ict", "registration": Errors(0.3, 0.9, 2.0), "matched": 0.874,
        "landmarks": [
            Found("chin", "given", 1.0, (0.125, -2.0, 3.0), 1.26), Found("nose_tip", "found", 0.7, (0, 1, 2), 0),
        ],
        "openings": {"mouth": "a hole in the scan"}, "reseated": {"eyeBlinkLeft": (0.913, 1.104)},
        "gaps": [Gap("lips", "at rest", 0.1, 0.5)],
    }  # fmt: skip
    return TransferReport(fit, **{**fields, **other})


def square(z: float, side: float = 40.0) -> Any:
    corners = np.array([[-side, -side, z], [side, -side, z], [side, side, z], [-side, side, z]])
    return make_scan(corners, np.array([[0, 1, 2], [0, 2, 3]]), "scan")


def test_the_table_has_every_figure_by_name() -> None:
    table = json.loads(json.dumps(as_table(report())))
    assert table["format"] == "omote transfer report" and table["version"] == 1
    assert (table["head"], table["expressions_from"]) == ("mia", "ict")
    assert table["scan_to_head_mm"] == {"face": {"samples": 5000, "rms": 0.2, "p99": 0.7, "max": 1.5}}
    assert table["registration_mm"] == {"rms": 0.3, "p99": 0.9, "max": 2.0} and table["registration_matched"] == 0.874
    assert table["landmarks"]["chin"] == {"how": "given", "sure": 1.0, "place": [0.125, -2.0, 3.0], "off_mm": 1.26}
    assert table["reseated"] == {"eyeBlinkLeft": {"least": 0.913, "most": 1.104}}
    assert table["gaps_mm"] == [{"what": "lips", "pose": "at rest", "mm": 0.1, "most_mm": 0.5}]
    assert table["parameters"] == ["jawOpen", "cheekPuff"] and table["notes"] == ["guessed the unit"]


def test_the_text_says_what_the_table_has() -> None:
    lines = as_markdown(report(), ["landmarks.png"]).splitlines()
    assert lines[0] == f"# mia: the expressions of ict, {report().fit.points} control points, 2 shapes"
    assert lines[2].startswith("- face: ") and lines[3] == "- guessed the unit"
    for row in (
        "| scan, head: 5000 samples of face | 0.200 | 0.700 | 1.500 |",
        "| the map alone, scan: 87 % of the front, where it has a match | 0.300 | 0.900 | 2.000 |",
        "![landmarks.png](landmarks.png)", module.LEGEND,
        "| chin | given | 1.00 | 0.125, -2, 3 | 1.3 |", "- mouth: a hole in the scan",
        "- eyeBlinkLeft: 0.91 to 1.10 times", "- lips, at rest: closed, 0.10 mm of at most 0.50",
    ):  # fmt: skip
        assert row in lines
    bare = as_markdown(report(reseated={}, gaps=[]), [])
    assert "\nnone\n" in bare and module.LEGEND not in bare and "png" not in bare and bare.endswith("\n")


def test_the_view_shows_the_face_from_its_chin_to_its_forehead() -> None:
    turn = Rotation.from_euler("xyz", [80, 10, 20], degrees=True).as_matrix()
    found = Similarity(turn, 10.0, np.array([1.0, 2.0, 3.0]))
    low, high = np.array([-40.0, -70.0, 0.0]), np.array([60.0, 30.0, 50.0])
    places = np.array([low, high, 0.5 * (low + high)])
    seen = view_of(found, (places - found.shift) @ turn / found.scale).pixels(
        (places - found.shift) @ turn / found.scale
    )
    tall = 100.0 * 1.7  # a quarter of the height below, 0.45 above
    per_mm = 900.0 / (1.25 * tall)
    middle = low + 0.5 * (high - low) * (1.0 + 0.45 - 0.25)
    np.testing.assert_allclose(seen[:, 0], 405.0 + per_mm * (places[:, 0] - middle[0]), atol=1e-6)
    np.testing.assert_allclose(seen[:, 1], 450.0 - per_mm * (places[:, 1] - middle[1]), atol=1e-6)


def head_of(*parts: tuple[str, float, float]) -> Any:
    """A head of flat square parts: material, height and half side of each."""
    every = []
    for material, z, side in parts:
        scan = square(z, side)
        every.append(
            SimpleNamespace(material=material, vertices=scan.vertices, triangles=scan.triangles.astype(np.int32))
        )
    return SimpleNamespace(parts=every, name="mia", placement=None)


@pytest.fixture(autouse=True)
def plain_heads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "Head", lambda data: data)
    monkeypatch.setattr(distances, "COUNT", 20_000)


def test_a_distance_is_along_the_normal_near_the_head_and_to_the_nearest_place_farther_off() -> None:
    skin = head_of(("skin", 0.0, 40.0), ("hair", 1.5, 40.0), ("eye", 30.0, 40.0))
    for z, wanted in ((0.0, 0.0), (1.5, 1.5), (-1.5, 1.5), (5.0, 5.0), (31.0, 1.0)):
        np.testing.assert_allclose(module._distances(square(z), skin), wanted, atol=0.03)
    beside = make_scan(np.array([[60.0, 0, 0], [61, 0, 0], [60, 1, 0.1]]), np.array([[0, 1, 2]]), "scan")
    np.testing.assert_allclose(module._distances(beside, skin), [20.3], atol=0.4)
    placed = head_of(("skin", 0.0, 40.0))
    placed.placement = SimpleNamespace(points=lambda rows: rows * [1.0, 1.0, 0.5])
    np.testing.assert_allclose(module._distances(square(3.0), placed), 1.5, atol=0.03)


def test_a_report_is_four_files_and_another_takes_its_place(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "report"
    for name in ("mia", "noa"):
        write_transfer_report(report(name), square(0.0), head_of(("skin", 0.0, 40.0)), HERE, folder)
        assert sorted(path.name for path in folder.iterdir()) == [
            "error.png",
            "landmarks.png",
            "report.json",
            "report.md",
        ]
        assert json.loads((folder / "report.json").read_text())["head"] == name
    with Image.open(folder / "landmarks.png") as marks, Image.open(folder / "error.png") as errors:
        assert marks.size == (2 * errors.width, errors.height)
    assert [path.name for path in folder.parent.iterdir()] == ["report"]  # nothing is left beside it


def test_a_folder_that_cannot_be_written_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(FitError, match="the report cannot be written") as caught:
        write_transfer_report(report(), square(0.0), head_of(("skin", 0.0, 40.0)), HERE, tmp_path / "file" / "report")
    assert "--report" in caught.value.hint and (tmp_path / "file").read_text() == "mine"
