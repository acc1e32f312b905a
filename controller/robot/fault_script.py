"""Reads fault scripts: timelines of faults that ``omote simulate --script FILE`` applies to a simulated bus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from controller.base.config import Number, Settings, load
from controller.base.plain_numbers import plain_number
from drivers.base.errors import DriverError
from drivers.sim.serving.timeline import Timeline
from drivers.sim.wire.faults import KINDS, MAX_VALUE, parse_fault

MAX_STEPS = 10_000
_Seconds = Annotated[Number, Field(ge=0, le=86_400)]


class FaultScript(Settings):
    """A timeline: each entry is a time in seconds, then ``fault SPEC ...``, ``clear [KIND]`` or ``place ID TICKS``."""

    name: str | None = None
    description: str = ""
    loop_s: _Seconds = 0.0
    timeline: Annotated[list[str], Field(max_length=MAX_STEPS)]


def load_fault_script(path: Path) -> Timeline:
    """Read the timeline of a file. Raises ConfigError, which lists every error, where it cannot be read or is wrong."""
    file = load(path, FaultScript, lambda file: _steps(file)[1])
    return Timeline(_steps(file)[0], file.loop_s)


def _steps(file: FaultScript) -> tuple[list[tuple[float, str]], list[str]]:
    """Return the valid steps of a file, and error messages for the others."""
    steps: list[tuple[float, str]] = []
    faults = []
    for i, text in enumerate(file.timeline):
        try:
            steps.append(_step(text, steps[-1][0] if steps else 0.0))
        except (DriverError, ValueError) as error:
            faults.append(f"timeline[{i}]: {error} (is {text[:80]!r})")
    if file.loop_s and steps and steps[-1][0] > file.loop_s:
        faults.append(f"loop_s: {file.loop_s:g} is before the last entry at {steps[-1][0]:g}")
    return steps, faults


def _step(text: str, earliest_s: float) -> tuple[float, str]:
    time_text, _, line = text.strip().partition(" ")
    at_s = plain_number(time_text)
    if at_s is None:
        raise ValueError("begins with a time in seconds, then the command")
    if not earliest_s <= at_s <= 86_400:
        raise ValueError(f"times must rise up to 86400; this one is not from {earliest_s:g} on")
    _check_command(line.split())
    return at_s, line.strip()


def _check_command(words: list[str]) -> None:
    """Raise DriverError or ValueError unless the words are a command of a timeline."""
    match words:
        case ["fault", _, *_]:
            for spec in words[1:]:
                parse_fault(spec)
        case ["clear"]:
            pass
        case ["clear", kind] if kind in KINDS:
            pass
        case ["clear", kind]:
            raise ValueError(f"there is no fault {kind!r}; there are {', '.join(sorted(KINDS))}")
        case ["place", number, ticks] if number.isdecimal() and ticks.removeprefix("-").isdecimal():
            if not abs(int(ticks)) <= MAX_VALUE:
                raise ValueError(f"positions go from {-MAX_VALUE:.0f} to {MAX_VALUE:.0f} steps")
        case _:
            raise ValueError("write fault SPEC, clear KIND or place ID TICKS after the time")
