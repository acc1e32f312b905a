"""The schema of the WebSocket API: the file in docs is the models', and a JSON Schema validator agrees with them."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import fastjsonschema
import pytest

from controller.links.websocket.messages import schema

FILE = Path(__file__).resolve().parents[4] / "docs" / "websocket.schema.json"
WRITE = ".venv/bin/python -m docs.make_websocket_schema"


def test_the_file_in_docs_is_up_to_date() -> None:
    assert json.loads(FILE.read_text(encoding="utf-8")) == schema(), f"write it again: {WRITE}"


@pytest.mark.parametrize(
    ("message", "is_good"),
    [
        ({"type": "set", "parameters": {"jawOpen": 0.5}}, True),
        ({"type": "gaze_at", "point_mm": [1, 2, 3], "id": "a"}, True),
        ({"type": "gaze_at", "point_mm": [1, 2]}, False),
        ({"type": "set"}, False),
        ({"type": "dance"}, False),
        ({"type": "stop", "more": 1}, False),
    ],
)
def test_a_validator_of_json_schema_agrees(message: dict[str, object], is_good: bool) -> None:
    whole = json.loads(FILE.read_text(encoding="utf-8"))
    check = fastjsonschema.compile({"$defs": whole["$defs"], **whole["properties"]["request"]})
    with nullcontext() if is_good else pytest.raises(fastjsonschema.JsonSchemaException):
        check(message)
