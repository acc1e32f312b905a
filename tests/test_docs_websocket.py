"""docs/websocket.md: its messages do what they say, its program runs, and its table of keys is the link's."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.links import read_link
from controller.links.websocket.conversation import Conversation
from controller.links.websocket.kind import WebSocketSettings
from controller.links.websocket.messages import schema
from controller.stage.stage import load_stage
from drivers.base.options import entries
from tests.controller.links.websocket.far import served

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "websocket.md").read_text(encoding="utf-8")
REQUESTS = re.findall(r"^\| `(\{.*?\})` \|", TEXT[: TEXT.index("| from omote")], re.M)


def test_every_message_of_the_table_is_taken_and_every_message_is_in_it() -> None:
    talk = Conversation(CommandState(P), "docs", 0)
    for text in REQUESTS:
        reply = talk.handle(json.dumps({"id": 1, **json.loads(text)}), 10**9)
        assert reply is not None
        refused = getattr(reply, "message", "")
        lacking = ("no shows", "there is one head", "no head called")  # here; tests of several heads try those
        assert not refused or any(each in refused for each in lacking), (text, refused)
    mapping = schema()["properties"]["request"]["discriminator"]["mapping"]
    assert {json.loads(text)["type"] for text in REQUESTS} == set(mapping)


def test_the_program_runs() -> None:
    (program,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    with served() as (state, link, url):
        exec(program.replace("ws://127.0.0.1:8765", url), {})
        assert link.report()["refused"] == {}
        assert state.status()["manual"] == 0


def test_keys_and_defaults_are_those_of_the_link() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*?)\|", TEXT[TEXT.index("| key | default") :], re.M))
    wanted = {entry.name: entry.default for entry in entries(WebSocketSettings)}
    assert rows.keys() == wanted.keys()
    plain = WebSocketSettings()
    for name, text in rows.items():
        shown = text.strip().strip("`")
        assert shown == "" or json.loads(shown) == getattr(plain, name)


def test_the_stages_can_be_read() -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", TEXT, re.S)
    (table,) = tomllib.loads(block)["links"]
    assert read_link(table).own == WebSocketSettings()
    stage = load_stage("websocket", P)
    assert [link.kind for link in stage.settings.links] == ["websocket"]
