"""Explains, for people, what is wrong with a message of the WebSocket API."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import ValidationError

from controller.base.parameters import did_you_mean

_MAX_FAULTS = 3
"""Number of a message's faults that its answer names."""
_MAX_ID_LENGTH = 64
_SURROGATE = re.compile(r"[\ud800-\udfff]")
"""Surrogate code points, which JSON can contain as escapes but UTF-8 cannot encode."""
_EXAMPLE = '{"type": "set", "parameters": {"jawOpen": 0.5}}'


def explain(error: ValidationError) -> tuple[str, str]:
    """Return what is wrong, in one line, and a hint."""
    found = error.errors(include_url=False, include_input=False)
    shown = "; ".join(map(_fault, found[:_MAX_FAULTS]))[:400]
    more = f"; and {len(found) - _MAX_FAULTS} more" if len(found) > _MAX_FAULTS else ""
    return shown + more, f"write it as {_EXAMPLE}"


def id_of(text: str | bytes) -> int | str | None:
    """Return the ``id`` of an invalid message; None if it has none that an answer can contain."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    given = found.get("id") if isinstance(found, dict) else None
    text_fits = isinstance(given, str) and len(given) <= _MAX_ID_LENGTH and _SURROGATE.search(given) is None
    fits = text_fits or (isinstance(given, int) and abs(given) < 1 << 53)
    return given if fits and not isinstance(given, bool) else None


def _fault(fault: Any) -> str:
    where, context = ".".join(map(str, fault["loc"]))[:80], fault.get("ctx", {})
    match fault["type"]:
        case "union_tag_invalid":
            given, known = str(context["tag"])[:80], re.findall(r"'([^']+)'", str(context["expected_tags"]))
            return f"type: unknown message {given!r}{did_you_mean(given, known) or ', there are ' + ', '.join(known)}"
        case "union_tag_not_found":
            return "type: missing, it says what a message is"
        case "model_type" | "model_attributes_type" | "dict_type" if not where:
            return "a message must be an object"
        case "extra_forbidden":
            return f"{where}: unknown key"
        case "missing":
            return f"{where}: missing"
        case "json_invalid":
            return f"not JSON: {context.get('error', '')}"
    reason = str(fault["msg"]).replace("Input should be", "must be").removeprefix("Value error, ")
    return f"{where}: {reason}" if where else reason
