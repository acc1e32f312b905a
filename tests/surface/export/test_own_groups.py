"""A user's own groups in files for other programs: shapes, correctives, animations, and what a page shows of them."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.base.errors import ExportError
from surface.export import Animation, export_head
from surface.export.glb_web import web_glb
from surface.export.shapes import export_parts
from surface.head import NAMES, Head, OwnGroup
from tests.surface.export.test_glb_motion import Played

POUT = NAMES.index("mouthPucker")
STATIC = Path(__file__).parents[3] / "controller/links/web/static"


@pytest.fixture
def head() -> Head:
    """One skin with a shape, an own group, and an own corrective of the shape."""
    found = Head(small_head(parts=[part("a", -40, groups=[all_points("mouthPucker", (0, 0, 5))])], seams=[]))
    up, out = (np.tile(way, (25, 1)) for way in ([0.0, 2.0, 0.0], [1.0, 0.0, 0.0]))
    fold = OwnGroup("foldHalf", "a", np.arange(25), out, ("mouthPucker",))
    found.add_groups([OwnGroup("earLeft", "a", np.arange(25), up), fold])
    return found


def test_they_are_shapes_behind_the_others(head: Head) -> None:
    (skin,) = export_parts(head)
    assert list(skin.displacements) == ["mouthPucker", "earLeft", "foldHalf"]
    for name, way in (("earLeft", (0, 2, 0)), ("foldHalf", (1, 0, 0))):
        assert skin.displacements[name] == pytest.approx(np.tile(way, (len(skin.vertices), 1)), abs=1e-4)


def test_a_file_opens_with_as_much_of_them_as_the_head_shows(head: Head, tmp_path: Path) -> None:
    """0.8 of a fold that belongs to a pout shows half of it in half a pout."""
    pose = {"earLeft": -0.25, "foldHalf": 0.8, "mouthPucker": 0.5}
    export_head(head, tmp_path / "h.glb", pose)
    (mesh,) = Played(tmp_path / "h.glb").document["meshes"]
    opened = dict(zip(mesh["extras"]["targetNames"], mesh["weights"], strict=True))
    assert opened == pytest.approx({"mouthPucker": 0.5, "earLeft": -0.25, "foldHalf": 0.4})
    head.pose(head.values(pose))
    rest, moves = export_parts(head)[0].vertices, export_parts(head)[0].displacements
    head.pose(head.values(pose))
    shown = rest + sum(opened[name] * moves[name] for name in moves)
    assert shown == pytest.approx(head.parts[0].vertices, abs=1e-3)


def test_own_parameters_that_rest_elsewhere_do_not_count_as_a_pose(head: Head, tmp_path: Path) -> None:
    for name, web in (("a.obj", False), ("b.glb", True)):
        assert export_head(head, tmp_path / name, {"foldHalf": 1.0}, web=web)
    assert sorted(path.stem for path in (tmp_path / "a_shapes").iterdir()) == ["earLeft", "foldHalf", "mouthPucker"]
    with pytest.raises(ExportError, match="at rest"):
        export_head(head, tmp_path / "b.glb", {"mouthPucker": 1.0}, web=True)


def test_an_animation_moves_them(head: Head, tmp_path: Path) -> None:
    times, rows = np.array([0.0, 0.5]), np.zeros((2, len(NAMES)))
    rows[1, POUT] = 1.0
    animation = Animation("twitch", times, rows, {"earLeft": np.array([0.0, 0.75])})
    export_head(head, tmp_path / "h.glb", animation=animation)
    ((_, weights),) = Played(tmp_path / "h.glb").channels("weights").values()
    assert weights.tolist() == [[0.0, 0.0, 0.0], [1.0, 0.75, 0.0]]
    with pytest.raises(ExportError, match="rise from 0"):
        Animation("twitch", times, rows, {"earLeft": np.zeros(3)})
    with pytest.raises(ExportError, match="no numbers"):
        Animation("twitch", times, rows, {"earLeft": np.array([0.0, np.inf])})


def test_the_file_for_pages_tells_what_they_are_multiplied_by(head: Head, tmp_path: Path) -> None:
    (tmp_path / "h.glb").write_bytes(web_glb(head))
    said = Played(tmp_path / "h.glb").document["extras"]["omote"]
    assert said["own"] == {"earLeft": [], "foldHalf": ["mouthPucker"]}
    assert said["half"] == [], "foldHalf is a user's own name"


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_a_page_shows_as_much_of_them_as_the_head(head: Head, tmp_path: Path) -> None:
    values = np.random.default_rng(5).uniform(-1.2, 1.2, (40, len(head.parameters)))
    (tmp_path / "pose.mjs").write_bytes((STATIC / "pose.js").read_bytes())
    program = (
        "import { ownAmounts } from './pose.mjs'; import { readFileSync } from 'fs';"
        "const { names, values, own } = JSON.parse(readFileSync(0));"
        "console.log(JSON.stringify(values.map(row => ownAmounts(names, row, own))));"
    )
    (tmp_path / "run.mjs").write_text(program)
    own = {group.name: list(group.times) for group in head.own_groups}
    orders = json.dumps({"names": list(head.parameters), "values": values.tolist(), "own": own})
    done = subprocess.run(["node", "run.mjs"], input=orders, capture_output=True, text=True, cwd=tmp_path, check=True)
    for row, found in zip(values, json.loads(done.stdout), strict=True):
        assert [found["earLeft"], found["foldHalf"]] == pytest.approx(head.own_amounts(row).tolist())
