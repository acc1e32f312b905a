"""What is wrong with a message, in words, and the id that its answer has."""

from __future__ import annotations

import json
from typing import Any

import pytest
from pydantic import ValidationError

from controller.links.websocket.faults import explain, id_of
from controller.links.websocket.messages import REQUESTS

SET = {"type": "set", "parameters": {"jawOpen": 0.5}}


def fault(text: str | dict[str, Any]) -> str:
    with pytest.raises(ValidationError) as caught:
        REQUESTS.validate_json(text if isinstance(text, str) else json.dumps(text))
    said, hint = explain(caught.value)
    assert hint == 'write it as {"type": "set", "parameters": {"jawOpen": 0.5}}' and "\n" not in said
    return said


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ({"type": "sett"}, "type: unknown message 'sett', did you mean 'set'"),
        ({"parameters": {}}, "type: missing, it says what a message is"),
        ("[]", "a message must be an object"),
        ("{", "not JSON: "),
        ({"type": "set", "parameters": {"jawOpen": 0.5}, "hold": 1}, "set.hold: unknown key"),
        ({"type": "set"}, "set.parameters: missing"),
    ],
)
def test_a_fault_is_said_with_its_key(message: Any, said: str) -> None:
    assert fault(message).startswith(said)


def test_an_unknown_message_like_none_names_all_there_are() -> None:
    said = fault({"type": "x" * 200})
    assert said.startswith(f"type: unknown message '{'x' * 80}', there are ") and "subscribe" in said and "set" in said


@pytest.mark.parametrize(("count", "more"), [(3, ""), (4, "; and 1 more"), (9, "; and 6 more")])
def test_of_many_faults_three_are_named(count: int, more: str) -> None:
    said = fault(SET | {f"k{i}": 1 for i in range(count)})
    assert said == "; ".join(f"set.k{i}: unknown key" for i in range(3)) + more


def test_a_fault_has_a_bounded_length() -> None:
    said = fault(SET | {c * 500: 1 for c in "abcd"})
    assert said == "; ".join(f"{('set.' + c * 500)[:80]}: unknown key" for c in "abc") + "; and 1 more"
    assert len(said) < 420


@pytest.mark.parametrize(
    ("given", "answered"),
    [
        (7, 7), (0, 0), (-5, -5), (2**53 - 1, 2**53 - 1), (2**53, None), (-(2**53) + 1, -(2**53) + 1), (-(2**53), None),
        ("a", "a"), ("", ""), ("a" * 64, "a" * 64), ("a" * 65, None), ("\ud800", None),
        (True, None), (False, None), (1.5, None), (None, None), ([1], None),
    ],
)  # fmt: skip
def test_an_id_is_a_short_text_or_a_number_that_every_client_can_hold(given: object, answered: object) -> None:
    found = id_of(json.dumps({"type": "sett", "id": given}))
    assert found == answered and type(found) is type(answered)


@pytest.mark.parametrize("text", ["{", "[]", "3", '"id"', "{}", "[" * 100_000, b"\xff"])
def test_what_is_no_message_has_no_id(text: str | bytes) -> None:
    assert id_of(text) is None
