"""Commands that took effect at one conductor, as JSON for another that stands by, also for one that is late."""

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
"""Methods, and how many of their arguments say what is to be done; the time comes behind those."""
_MOST = 65_536


def encode(method: str, arguments: tuple[Any, ...]) -> bytes | None:
    """A call of a :class:`controller.layers.commands.CommandState` as JSON; None for ticks."""
    if method in _PLAIN:
        given = [_plain(each) for each in arguments[: _PLAIN[method]]]
    elif method == "live":
        given = [arguments[0], *arguments[2:3]]
    elif method == "write_layer":
        name, values, mask, _, _, through = arguments
        given = [name, *map(_plain, (values, mask, through))]
    else:
        return None
    return json.dumps({"version": VERSION, "method": method, "arguments": given}).encode()


def apply(data: bytes, state: CommandState, now_ns: int) -> None:
    """Carry out at ``now_ns`` what :func:`encode` wrote. Raises LinkError: it is none of that, or does not fit."""
    try:
        table = json.loads(data[:_MOST])
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
            raise LinkError(f"{str(method)[:40]!r} is no event")
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, ParameterError) as error:
        raise LinkError(f"an event that cannot be carried out: {error}") from error


def snapshot(state: CommandState) -> dict[str, Any]:
    """What was commanded and still holds, for one that comes late."""
    status, names = state.status(), state.parameters.names
    return {
        "held": {names[i]: value for i, value in state.held().items()},
        "expression": [status["expression"], status["intensity"]],
        "gaze": state.gaze_rad,
        "life": [state.liveliness, state.manner],
    }


def restore(given: dict[str, Any], state: CommandState, now_ns: int) -> None:
    """Command what :func:`snapshot` found. Raises LinkError: it does not fit."""
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


def _plain(value: Any) -> Any:
    """Arrays and sequences as lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple | list | range) else value
