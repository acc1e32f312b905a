"""``omote bench`` of the surface at small sizes: every table and picture is there; no figure is judged."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from controller.base.errors import ControllerError
from controller.cli.app import make_app
from controller.cli.bench import console
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


def test_the_surface_with_a_large_one_and_growth(tmp_path: Path) -> None:
    svg = tmp_path / "growth.svg"
    text = said("surface", "--seconds", "0.01", "--vertices", "1000", "--large", "--growth", str(svg))
    for title in ("about 1,000 vertices", "about 10,000 vertices", "growth, from 256 to 10,000 vertices"):
        assert title in text
    for row in ("all positions and normals", "scipy CSR @ dense", "two threads", "memory of weights", "tree and lists"):
        assert row in text
    for bound in ("<= 1.8", "<= 3.5", ">= 12", ">= 3", "<= 1.3", "0.9 to 1.1"):
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


@pytest.mark.parametrize(("place", "why"), [("file/a.svg", "cannot be written"), ("a.doc", "no picture is named so")])
def test_places_that_cannot_be_written_are_refused_at_once(tmp_path: Path, place: str, why: str) -> None:
    (tmp_path / "file").touch()
    words = ["bench", "surface", "--growth", str(tmp_path / place)]
    error = CliRunner().invoke(make_app(), words).exception
    assert isinstance(error, ControllerError)
    assert why in str(error)
    assert error.hint
