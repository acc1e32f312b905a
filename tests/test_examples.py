"""The programs of examples/ do what they say."""

from __future__ import annotations

import base64
import io
import re
import subprocess
import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from surface.head.model.data import Group
from surface.head.model.file import load_data, save_data
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import NAMES, read_pose
from surface.head.posing.rig import SkinRig, rigid_motion
from tests.surface.small_head import part, small_head

SHAPES = {"jawOpen": 0.4, "mouthSmileLeft": 0.9, "browInnerUp": 0.7, "jawLeft": 0.5, "mouthShrugLower": 0.6}


def load(path: Path) -> ModuleType:
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def draw_head(root: Path) -> ModuleType:
    return load(root / "examples" / "draw_head.py")


@pytest.fixture(scope="module")
def found(draw_head: ModuleType, root: Path) -> list:
    return list(draw_head.parts_of(root / "configs" / "heads" / "ict", SHAPES))


@pytest.mark.slow
def test_a_head_is_evaluated_from_its_files_alone_as_the_engine_does(found: list, root: Path) -> None:
    """Without contacts and lids, which the program leaves out; the engine sums displacements in 32-bit numbers."""
    folder = root / "configs" / "heads" / "ict"
    head = replace(load_data(folder), contacts=[])
    pose = read_pose(np.array([SHAPES.get(name, 0.0) for name in NAMES]))
    assert [material for material, *_ in found] == [p.material for p in head.parts]
    for own, (_, vertices, triangles) in zip(head.parts, found, strict=True):
        surface = make_surface(own)
        if own.follows == "skin":
            points = SkinRig(replace(own, lids=np.zeros(len(own.points))), head).apply(pose)
        else:
            linear, shift = rigid_motion(own.follows, head, pose)
            points = own.points @ linear.T + shift
        expected = surface.with_points(points).evaluate(own.mesh["mesh_uv"], own.mesh["mesh_side"])
        assert np.abs(vertices - expected).max() < 5e-6  # mm
        assert np.array_equal(triangles, own.mesh["mesh_triangles"])


def test_blending_functions_take_both_limits(draw_head: ModuleType) -> None:
    knots = np.array([[0.0, 0, 0, 1, 1], [0.0, 1, 2, 3, 4]])
    left = np.array([False, True, False, True])
    found = draw_head.blending(knots[:1], 3, np.array([1.0, 1.0, 0.5, 0.5]), left)
    assert np.allclose(found, [[0, 0, 0.375, 0.375]])
    found = draw_head.blending(knots[1:], 3, np.array([1.0, 2.0, 4.0, 3.5]), left)
    assert np.allclose(found, [[1 / 6, 2 / 3, 0, 1 / 48]])
    steps = draw_head.blending(np.array([[0.0, 1.0]]), 0, np.array([0.0, 1.0, 1.0, 0.0]), left)
    assert steps.tolist() == [[1, 1, 0, 0]]


@pytest.mark.slow
def test_a_picture_of_a_head_is_drawn(draw_head: ModuleType, found: list, root: Path, tmp_path: Path) -> None:
    """With numpy alone: skin, teeth and the dark of the mouth are there, and the near hides the far."""
    image = pytest.importorskip("PIL.Image", reason="Pillow reads the picture: pip install omote[view]")
    draw_head.write_png(tmp_path / "head.png", draw_head.draw(iter(found), 360, 1.2))
    pixels = np.asarray(image.open(tmp_path / "head.png")).astype(int)
    assert pixels.shape == (360, 360, 3) and (pixels[:20, :30] == 244).all()
    nose, mouth = pixels[145, 180], pixels[180:210, 165:195].reshape(-1, 3)
    assert nose[0] > nose[1] + 20 > nose[2] + 20
    pale = (np.ptp(mouth, axis=1) < 40) & (mouth.min(axis=1) > 120)
    assert 0.05 < pale.mean() < 0.5  # teeth between lips
    used = {
        line.split()[1] for line in (root / "examples" / "draw_head.py").read_text().splitlines() if "import " in line
    }
    assert not used & {"surface", "controller", "omote"}


def test_words_that_are_missing_are_told(root: Path) -> None:
    done = subprocess.run([sys.executable, root / "examples" / "draw_head.py"], capture_output=True, text=True)
    assert done.returncode == 1 and "usage: python examples/draw_head.py" in done.stderr


@pytest.fixture(scope="module")
def page(root: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of the paper for a small head, in its short form."""
    pytest.importorskip("PIL.Image", reason="Pillow draws the meshes: pip install omote[view]")
    folder = tmp_path_factory.mktemp("paper")
    bump = Group("jawOpen", np.arange(25, dtype=np.int32), np.full((25, 3), [0, -3, 2], np.float32))
    save_data(folder / "head", small_head(parts=[part("face", -40, groups=[bump])], seams=[], paint=[]))
    paper = load(root / "examples" / "paper.py")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["paper.py", str(folder / "paper.html"), "--head", str(folder / "head"), "--short"])
        patch.setattr(paper, "EXPRESSIONS", {"at rest": {}, "open": {"jawOpen": 1.0}})
        paper.main()
    return (folder / "paper.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_of_the_paper_has_its_numbers_beside_ours(page: str) -> None:
    rows = [[re.sub("<.*?>", "", cell) for cell in re.split("<t[dh]>", row)[1:]] for row in page.split("<tr>")[1:]]
    rows = [[cell.split("</table>")[0] for cell in row] for row in rows]
    assert rows[0] == ["", "the paper", "omote"]
    told = {row[0]: row[1:] for row in rows[1:]}
    assert told["data saved by control points, at equal greatest deviation"][0] == "50.2 %"
    assert {f"data saved by chord error, at equal {m}" for m in ("root mean square", "99 % of the area")} <= set(told)
    paper, ours = told["all vertices of a pose, every parameter moving"]
    assert paper == "14.3 frames/s" and float(ours.split()[0]) > 100
    saved = [cell[1] for name, cell in told.items() if name.startswith("data saved by chord")]
    assert all(text == "none found" or re.fullmatch(r"[\d.]+ %|none: [\d.]+ % more", text) for text in saved)


def embedded(text: str) -> np.ndarray:
    """The picture, (h, w, 3), in a part of a page."""
    from PIL import Image

    found = re.search(r"data:image/png;base64,([^\"]+)", text)
    assert found
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(found[1]))).convert("RGB"))


def test_a_mesh_that_saves_nothing_tells_how_much_more_it_needs(root: Path) -> None:
    in_words = load(root / "examples" / "paper.py").in_words
    assert [in_words(x) for x in (0.502, 0.0, -1.663)] == ["50.2 %", "0.0 %", "none: 166.3 % more"]


@pytest.mark.slow
def test_the_page_of_the_paper_has_its_figures(page: str) -> None:
    sections = page.split("<h2>")[1:]
    assert [s.split(".")[0] for s in sections[1:5]] == ["2"] * 4 and sections[5].startswith("3 Experiment")
    assert sections[1].count("<circle") == 25 and sections[1].count("<rect") == 12
    assert "data:image/png;base64," in sections[2]
    cells, touched = (embedded(text) for text in sections[3:5])
    orange = [(x[..., 0] > 190) & (x[..., 2] < 100) & (x[..., 1] > 90) for x in (cells, touched)]
    assert not orange[0].any() and orange[1].mean() > 0.02
    assert ((cells > 250).all(axis=2)).mean() < 0.01, "cells cover the whole of (u, v)"
    assert "at rest" in sections[5] or "No pictures" in sections[5]
