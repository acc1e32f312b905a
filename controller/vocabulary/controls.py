"""Reads files of ``configs/controls``: what MIDI controllers, and axes, buttons and keys of the window, do."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from controller.base.config import Fraction, Number, Settings, load
from controller.base.errors import ParameterError
from controller.base.parameters import Parameters
from controller.vocabulary.sides import unknown_names
from controller.vocabulary.vocabulary import Vocabulary

Amount = Annotated[Number, Field(ge=-1, le=1)]
Action = Annotated[str, Field(max_length=128)] | dict[str, Amount]
"""What a button does: show an expression, or hold parameters at values while it is down."""
MidiController = Annotated[int, Field(ge=0, le=119)]
"""Number of a MIDI controller; numbers above 119 are channel mode messages."""
AXES = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")
"""Axes of a gamepad, in the order of GLFW."""
BUTTONS = (
    "a", "b", "x", "y", "left_bumper", "right_bumper", "back", "start", "guide", "left_thumb", "right_thumb",
    "dpad_up", "dpad_right", "dpad_down", "dpad_left",
)  # fmt: skip
"""Buttons of a gamepad, in the order of GLFW."""


class ControlsFile(Settings):
    """The contents of a file: MIDI controllers by parameter, and what axes, buttons and keys do."""

    controllers: dict[str, MidiController] = {}
    dead_zone: Fraction = 0.1
    axes: dict[str, dict[str, Amount]] = {}
    buttons: dict[str, Action] = {}
    keys: Annotated[dict[str, Action], Field(max_length=256)] = {}


def load_controls(path: Path, parameters: Parameters, vocabulary: Vocabulary | None = None) -> ControlsFile:
    """Read a file of controls.

    ``vocabulary`` : where expressions are looked up. Default: the shipped vocabulary.

    Raises ConfigError: the file cannot be read or is wrong; lists every fault with its key.
    """
    known = vocabulary or Vocabulary.load(parameters)
    return load(path, ControlsFile, lambda file: _faults(file, parameters, known))


def _faults(file: ControlsFile, parameters: Parameters, vocabulary: Vocabulary) -> list[str]:
    """Return the faults of a file: unknown names, and MIDI controllers that move two parameters."""
    faults = unknown_names(parameters, "controllers", file.controllers)
    numbers = list(file.controllers.values())
    faults += [f"controllers: {number} moves two parameters" for number in {*numbers} if numbers.count(number) > 1]
    faults += [f"axes.{name}: no axis; there are {', '.join(AXES)}" for name in file.axes if name not in AXES]
    faults += [f"buttons.{name}: no button; there are {', '.join(BUTTONS)}" for name in file.buttons
               if name not in BUTTONS]  # fmt: skip
    for axis, weights in file.axes.items():
        faults += unknown_names(parameters, f"axes.{axis}", weights)
    for table, actions in (("buttons", file.buttons), ("keys", file.keys)):
        for name, action in actions.items():
            faults += _action_faults(f"{table}.{name}", action, parameters, vocabulary)
    return faults


def _action_faults(where: str, action: Action, parameters: Parameters, vocabulary: Vocabulary) -> list[str]:
    if not isinstance(action, str):
        return unknown_names(parameters, where, action)
    try:
        vocabulary[action]
    except ParameterError as error:
        return [f"{where}: {error}"]
    return []
