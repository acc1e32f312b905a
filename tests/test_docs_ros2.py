"""docs/ros2.md: its stage is read, its keys are those of the link, and its topics those of the node."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="pip install 'omote[ros2]'")
pytest.importorskip("rosbags", reason="pip install 'omote[ros2]'")

from controller.base.parameters import PARAMETERS as P
from controller.links.ros2.kind import DISTRIBUTIONS, Ros2Settings
from controller.stage.stage import load_stage
from tests.controller.fleet.nodes import router, until
from tests.controller.links.ros2.test_link import Near, graph

TEXT = (Path(__file__).parents[1] / "docs" / "ros2.md").read_text()


def rows(heading: str) -> list[list[str]]:
    """Cells of the table that begins with a heading."""
    lines = TEXT[TEXT.index(heading) :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_the_stage_of_the_page_is_read(tmp_path: Path) -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    path = tmp_path / "stage.toml"
    path.write_text(block)
    (link,) = load_stage(str(path), P).settings.links
    assert link.kind == "ros2" and load_stage(str(path), P).robots


def test_every_key_is_listed_with_its_default() -> None:
    written = {name.strip("`"): default.strip('`"') for name, default, _ in rows("| key | default |")}
    defaults = {field.name: field.default for field in fields(Ros2Settings)}
    assert written.keys() == defaults.keys()
    for name in ("connect", "node", "namespace", "distribution", "layer"):
        assert written[name] == defaults[name]
    assert float(written["rate_hz"]) == defaults["rate_hz"] and (written["frames"] == "true") is defaults["frames"]
    assert all(f'"{name}"' in TEXT for name in DISTRIBUTIONS)


@pytest.mark.slow
def test_the_topics_are_those_of_the_node(root: Path) -> None:
    """By the tokens that the graph of ROS is made of, as another session sees them."""
    with router() as endpoint:
        near = Near(endpoint, root / "configs" / "heads" / "ict", namespace="/")
        try:
            found = [*rows("| topic | type"), *rows("| topic that omote")]
            listed = {(name.strip("`").removeprefix("/"), kind.strip("`")) for name, kind, _ in found}
            until(lambda: len(graph(endpoint)) == len(listed))
            assert graph(endpoint) == listed
        finally:
            near.close()
