"""Just enough TOML writing for a head file; the standard library only reads it."""

from __future__ import annotations

import json
from typing import Any


def toml_text(table: dict[str, Any]) -> str:
    """A table as TOML text: plain values first, then sub-tables, then arrays of tables."""
    return "\n".join(_lines(table, "")) + "\n"


def _lines(table: dict[str, Any], prefix: str) -> list[str]:
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and not _is_tables(v)}
    out = [f"{k} = {_value(v)}" for k, v in plain.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            out += ["", f"[{prefix}{key}]", *_lines(value, f"{prefix}{key}.")]
        elif _is_tables(value):
            for item in value:
                out += ["", f"[[{prefix}{key}]]", *_lines(item, f"{prefix}{key}.")]
    return out


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    return repr(float(value)) if isinstance(value, float) else str(value)
