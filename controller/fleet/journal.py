"""Encodes commands that took effect at a conductor as JSON for a standby, and snapshots for one that starts later."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from controller.base.errors import LinkError, ParameterError
from controller.layers.commands import CommandState

VERSION = 1
_PLAIN = {
    "set_parameters": 2, "release": 1, "expression": 3, "gaze": 2, "gaze_at": 3, "gaze_off": 0, "neutral": 1,
}  # fmt: skip
"""Methods, and the number of their arguments before the time."""
_MAX_BYTES = 65_536


def encode(method: str, arguments: tuple[Any, ...]) -> bytes | None:
    """Encode a call of a :class:`controller.layers.commands.CommandState` as JSON; return None for other methods."""
    if method in _PLAIN:
        given = [_to_json(each) for each in arguments[: _PLAIN[method]]]
    elif method == "live":
        given = [arguments[0], *arguments[2:3]]
    elif method == "write_layer":
        name, values, mask, _, _, through = arguments
        given = [name, *map(_to_json, (values, mask, through))]
    else:
        return None
    return json.dumps({"version": VERSION, "method": method, "arguments": given}).encode()


def apply(data: bytes, state: CommandState, now_ns: int) -> None:
    """Carry out at ``now_ns`` what :func:`encode` returned. Raises LinkError: it is malformed or does not fit."""
    try:
        table = json.loads(data[:_MAX_BYTES])
        method, given = table["method"], table["arguments"]
        if table["version"] != VERSION:
            raise LinkError(f"version {table['version']!r} of an event is not understood")
        if method in _PLAIN and len(given) == _PLAIN[method]:
            getattr(state, method)(*given, now_ns)
        elif method == "live":
            state.live(given[0], now_ns, *given[1:2])
        elif method == "write_layer":
            _write_layer(state, given, now_ns)
        else:
            raise LinkError(f"{str(method)[:40]!r} is not an event")
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, ParameterError) as error:
        raise LinkError(f"an event that cannot be carried out: {error}") from error


def snapshot(state: CommandState) -> dict[str, Any]:
    """Return what was commanded and is still in force, for a standby that starts later."""
    status, names = state.status(), state.parameters.names
    return {
        "held": {names[i]: value for i, value in state.held().items()},
        "expression": [status["expression"], status["intensity"]],
        "gaze": state.gaze_rad,
        "life": [state.liveliness, state.manner],
    }


def restore(given: dict[str, Any], state: CommandState, now_ns: int) -> None:
    """Command what :func:`snapshot` returned. Raises LinkError: it does not fit."""
    try:
        held = {state.parameters.index(name): float(value) for name, value in given["held"].items()}
        if held:
            state.set_parameters(list(held), list(held.values()), now_ns)
        state.expression(str(given["expression"][0]), float(given["expression"][1]), None, now_ns)
        state.live(float(given["life"][0]), now_ns, str(given["life"][1]))
        if given["gaze"] is not None:
            yaw, pitch = map(float, given["gaze"])
            state.gaze(yaw, pitch, now_ns)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, ParameterError) as error:
        raise LinkError(f"a state that cannot be taken over: {error}") from error


def _write_layer(state: CommandState, given: list[Any], now_ns: int) -> None:
    name, values, mask, through = given
    p = len(state.parameters)
    arrays = [np.array(values, float), np.array(mask, bool)]
    shown = None if through is None else np.array(through, float)
    if any(array.shape != (p,) for array in (*arrays, *([] if shown is None else [shown]))):
        raise LinkError("a layer of other parameters")
    state.write_layer(str(name), arrays[0], arrays[1], now_ns, now_ns, through=shown)


def _to_json(value: Any) -> Any:
    """Convert arrays and sequences to lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple | list | range) else value
