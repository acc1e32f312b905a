"""``omote bench`` of the surface at small sizes: every table and picture is there; no figure is judged."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from controller.base.errors import ControllerError
from controller.cli.app import make_app
from controller.cli.bench import console
from controller.tools import bench_bus as bus_module
from controller.tools import bench_surface as surface_module
from controller.tools.bench_bus import Figure
from surface.bench.bench import Measure
from surface.head.model.file import save_data
from tests.surface.small_head import part, small_head


@pytest.fixture(autouse=True)
def wide_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wide enough that no title or row is broken; the console reads the terminal's width only once."""
    monkeypatch.setattr(console, "width", 200)


def said(*words: str) -> str:
    result = CliRunner().invoke(make_app(), ["bench", *words])
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())  # a title is broken where its table ends


@pytest.mark.slow
def test_the_surface_with_a_large_one_and_growth(tmp_path: Path) -> None:
    svg = tmp_path / "growth.svg"
    text = said("surface", "--seconds", "0.01", "--vertices", "1000", "--large", "--growth", str(svg))
    for title in ("about 1,000 vertices", "about 10,000 vertices", "growth, from 256 to 10,000 vertices"):
        assert title in text
    for row in ("all positions and normals", "scipy CSR @ dense", "two threads", "memory of weights", "tree and lists"):
        assert row in text
    for bound in ("<= 1.8", "<= 3.5", ">= 12", ">= 3", "<= 0.6", "0.9 to 1.1"):
        assert bound in text
    for name in ("splinepy", "geomdl"):
        assert (f"{name}, positions" in text) == (find_spec(name) is not None)
    root = ElementTree.parse(svg).getroot()
    assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) > 20
    assert [file.name for file in tmp_path.iterdir()] == ["growth.svg"]


@pytest.fixture(scope="module")
def head(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder with a head whose face is one small patch."""
    folder = tmp_path_factory.mktemp("head")
    save_data(folder, small_head(parts=[part("face", -40)], seams=[], paint=[]))
    return str(folder)


def test_drift_of_a_head(head: str) -> None:
    text = said("drift", "--updates", "2100", "--head", head)
    assert "after 2056 moves of one point" in text
    assert "greatest error of a vertex" in text
    assert "missed" not in text


@pytest.mark.slow
def test_quad_trees_are_drawn_side_by_side(tmp_path: Path, head: str) -> None:
    image = pytest.importorskip("PIL.Image")
    picture = tmp_path / "trees.png"
    text = said("quadtree", "--level", "3", "--head", head, "-o", str(picture))
    assert "at equal greatest deviation" in text
    assert "at equal deviation of 99% of the area" in text
    assert text.count("uniform: ") == 2
    assert text.count("by chord error: ") == 2
    with image.open(picture) as drawn:
        assert drawn.height == 900
        assert drawn.width > 900


@pytest.mark.parametrize(
    ("place", "why"), [("file/a.svg", "cannot be written"), ("a.doc", "unknown suffix of a picture")]
)
def test_places_that_cannot_be_written_are_refused_at_once(tmp_path: Path, place: str, why: str) -> None:
    (tmp_path / "file").touch()
    words = ["bench", "surface", "--growth", str(tmp_path / place)]
    error = CliRunner().invoke(make_app(), words).exception
    assert isinstance(error, ControllerError)
    assert why in str(error)
    assert error.hint


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What would be measured, in place of measuring it; every table has three rows."""
    found: list[tuple[Any, ...]] = []
    rows = [
        Measure("one", 1.23456, 2.0, "the other", "<= 1.5"),
        Measure("two", 0.0, 0.5, "", "<= 1"),
        Measure("three", 4.0),
    ]

    def noting(name: str) -> Any:
        def note(*words: Any) -> list[tuple[str, list[Measure]]]:
            found.append((name, *(word for word in words if not callable(word))))
            for word in words:
                if callable(word) and name != "bench_large":
                    word("something")
            return [(f"table of {name}", rows)]

        return note

    for name in ("head", "surface", "large", "growth", "drift", "quadtree", "crowd"):
        monkeypatch.setattr(surface_module, f"bench_{name}", noting(f"bench_{name}"))
    return found


def test_without_options_the_shipped_head_is_measured(calls: list[tuple[Any, ...]]) -> None:
    text = said()
    assert calls == [("bench_head", "ict", 0.3)]
    assert "table of bench_head" in text
    rows = text.replace("│", " ").replace("┃", " ")
    words = " ".join(rows.split())
    assert "one 1.235 2.00 the other <= 1.5 missed" in words
    assert "two 0.50 <= 1 met" in words  # no time was taken
    assert "three 4.000" in words and "measure ms ratio ratio to bound" in words


@pytest.mark.slow
def test_every_subject_is_given_its_own_options(calls: list[tuple[Any, ...]], tmp_path: Path) -> None:
    said("surface")
    said("drift")
    said("quadtree")
    said("crowd", "--heads", "8")
    assert calls == [
        ("bench_surface", 0.3, 100_000, "ict"), ("bench_drift", "ict", 1_000_000), ("bench_quadtree", "ict", 7, None),
        ("bench_crowd", "ict", 8, 0.3),
    ]  # fmt: skip
    calls.clear()
    svg, png = tmp_path / "a.svg", tmp_path / "b.PNG"
    assert "table of bench_large" in said("surface", "--large", "--vertices", "1000", "--seconds", "0.01")
    said("surface", "--growth", str(svg))
    said("quadtree", "--out", str(png), "--level", "9", "--head", "me")
    said("drift", "--updates", "1", "--head", "me")
    said("quadtree", "--level", "0")
    names = [call[:3] for call in calls]
    assert names == [
        ("bench_surface", 0.01, 1000), ("bench_large", 0.01, 1000), ("bench_surface", 0.3, 100_000),
        ("bench_growth", 0.3, calls[3][2]), ("bench_quadtree", "me", 9), ("bench_drift", "me", 1),
        ("bench_quadtree", "ict", 0),
    ]  # fmt: skip
    assert calls[3][3] == 100_000 and Path(calls[3][2]).parent == tmp_path == Path(calls[4][3]).parent
    assert calls[6][3] is None


@pytest.mark.parametrize(
    "words",
    [
        ("--seconds", "0.009"), ("--vertices", "999"), ("--level", "-1"), ("--level", "10"), ("--updates", "0"),
        ("nothing",),
    ],
)  # fmt: skip
def test_options_have_limits(calls: list[tuple[Any, ...]], words: tuple[str, ...]) -> None:
    assert CliRunner().invoke(make_app(), ["bench", *words]).exit_code == 2
    assert calls == []


def test_the_bus_is_measured_for_a_second_at_least_and_told_as_a_table_or_json(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[float, bool]] = []

    def bench_bus(seconds: float, log: Any, *, face: bool) -> list[tuple[str, list[Figure]]]:
        calls.append((seconds, face))
        log("loops [1 of 3]")
        row = Figure("  late by", 1.239, "ms", "<= 2 ms", True)
        return [("24 servos", [row, Figure("ticks", 7.0, "Hz", ">= 9", False), Figure("frames", 5.0, "frames/s")])]

    monkeypatch.setattr(bus_module, "bench_bus", bench_bus)
    words = said("bus").replace("│", " ").replace("┃", " ")
    text = " ".join(words.split())
    assert "24 servos" in text and "measure bound" in text
    for row in ("late by 1.24 ms <= 2 ms met", "ticks 7.00 Hz >= 9 missed", "frames 5.00 frames/s"):
        assert row in text
    result = CliRunner().invoke(make_app(), ["bench", "bus", "--json", "--face", "--seconds", "2.5"])
    assert result.stderr.startswith("measuring loops")
    assert [row["name"] for row in json.loads(result.stdout)["24 servos"]] == ["late by", "ticks", "frames"]
    assert calls == [(1.0, False), (2.5, True)]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("surface", "--out", "a.png"), "--out is for quadtree, not for surface"),
        (("head", "--growth", "a.svg"), "--growth is for surface, not for head"),
        (("drift", "--face"), "--face is for bus, not for drift"),
        (("crowd", "--json"), "--json is for bus, not for crowd"),
        (("head", "--buses", "2"), "--buses is for bus, not for head"),
        (("surface", "--real", "/dev/x"), "--real is for bus, not for surface"),
        (("bus", "--real", "/dev/x", "--buses", "2"), "leave out one of them"),
    ],
)
def test_an_option_of_another_subject_is_refused(words: tuple[str, ...], said: str) -> None:
    found = CliRunner().invoke(make_app(), ["bench", *words])
    assert isinstance(found.exception, ControllerError)
    assert said in f"{found.exception} {found.exception.hint}"
