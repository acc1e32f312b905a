"""Reads scripts: timed lines of the line protocol that a simulated robot host sends or a show plays."""

from __future__ import annotations

import math
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from controller.base.config import Number, Settings, load
from controller.base.errors import ConfigError
from controller.base.parameters import Floats, Parameters, did_you_mean
from controller.base.paths import config_dir, find_config
from controller.base.plain_numbers import plain_number
from controller.links.line.commands import Grammar, quoted
from controller.links.line.protocol import LineError
from controller.vocabulary.vocabulary import Vocabulary
from surface.base.files import read_toml

_SUFFIX = ".toml"
_WORD = re.compile(r"[!-)+-~]{1,100}")
_NAME = re.compile(r"(?![.])[^/\\\x00-\x1f\x7f]{1,100}")
"""Name of a script that a robot may request: without a folder, not hidden, and valid in any file system."""

MAX_STEPS = 50_000
"""Greatest number of timed lines in a script."""
_Seconds = Annotated[Number, Field(ge=0, le=86_400)]


class _File(Settings):
    name: str | None = None
    description: str = ""
    loop_s: _Seconds = 0.0
    frames_hz: Annotated[Number, Field(ge=0, le=200)] = 0.0
    marks: dict[str, _Seconds] = {}
    sound: str | None = None
    steps: Annotated[list[str], Field(max_length=MAX_STEPS)] = []
    keys: Annotated[list[dict[str, Any]], Field(max_length=1000)] = []
    """Keys of the timeline from which the steps were made; see controller.takes.timeline."""


@dataclass(frozen=True)
class Script:
    """A script, which a robot host sends or a show plays.

    steps : (time s, line), sorted by time.
    loop_s : after how long it begins again; 0 plays it once.
    frames_hz : how often every parameter is sent in addition; 0 for never.
    marks : times (s) by name.
    sound : sound file for a film; a run plays no sound.
    """

    steps: tuple[tuple[float, str], ...]
    loop_s: float = 0.0
    frames_hz: float = 0.0
    name: str = ""
    marks: dict[str, float] = field(default_factory=dict)
    sound: Path | None = None


def _read_steps(file: _File, grammar: Grammar) -> tuple[list[tuple[float, str]], list[str]]:
    """Return the valid steps of a file, and the faults of the file."""
    steps: list[tuple[float, str]] = []
    faults = []
    for i, text in enumerate(file.steps):
        try:
            steps.append(read_step(text, grammar, steps[-1][0] if steps else 0.0))
        except (LineError, ValueError) as error:
            faults.append(f"steps[{i}]: {error} (is {text!r})")
    if file.loop_s and steps and steps[-1][0] > file.loop_s:
        faults.append(f"loop_s: {file.loop_s:g} is before the last step at {steps[-1][0]:g}")
    if file.sound is not None and not _is_inside_folder(file.sound):
        faults.append(f"sound: must be a file in the folder of the script or below (is {file.sound!r})")
    return steps, faults


def _is_inside_folder(name: str) -> bool:
    """Whether the name of a file in a script stays inside the script's folder."""
    return bool(name) and not Path(name).is_absolute() and ".." not in Path(name).parts and "\0" not in name


def read_step(text: str, grammar: Grammar, earliest_s: float = 0.0) -> tuple[float, str]:
    """Return time (s) and line of a step such as ``0.5 EXPR smile``. Raises LineError or ValueError: it is invalid."""
    time_text, _, line = text.strip().partition(" ")
    at_s = plain_number(time_text)
    if at_s is None:
        raise ValueError("begins with a time in seconds, then the line")
    if not earliest_s <= at_s:
        raise ValueError(f"times must rise from 0; this one is before {earliest_s:g}")
    if grammar.parse(line.encode("utf-8")) is None:
        raise ValueError("no command after the time")
    return at_s, line.strip()


def load_script(
    name: str, parameters: Parameters, vocabulary: Vocabulary | None = None, *, beside: Path | None = None
) -> Script:
    """Read the script at a path or of a name in ``configs/scripts``.

    vocabulary : the named expressions. Default: the shipped ones. beside : the file that names the script, whose folder
    is searched first.

    Raises ConfigError: the script is not there or is invalid; it lists every fault with its key.
    """
    return _load(find_config("scripts", name, beside=beside), parameters, vocabulary)


def load_named_script(
    name: str, parameters: Parameters, vocabulary: Vocabulary | None = None, *, beside: Path | None = None
) -> Script:
    """Read a script that a robot requests by name, from the folder of ``beside`` or from ``configs/scripts``.

    A robot gets no other file: ``name`` cannot be a path, and links out of these folders are not followed. Because
    robots may request scripts at any rate, a file that has not changed is not read again.

    Raises ConfigError: there is no such script, or it is invalid; it lists every fault with its key.
    """
    for folder in _folders(beside) if _NAME.fullmatch(name) else ():
        file = folder / f"{name.removesuffix(_SUFFIX)}{_SUFFIX}"
        state = _state_inside(file)
        if state is not None:
            return _load_cached(file, state, parameters, vocabulary)
    known = sorted(path.stem for path in (config_dir() / "scripts").glob(f"*{_SUFFIX}"))
    message = f"no script {quoted(name)} in the folders of the stage and of configs/scripts{did_you_mean(name, known)}"
    raise ConfigError(message, hint=f"there are {', '.join(known)}")


def script_names(beside: Path | None = None) -> list[str]:
    """Return the sorted names of scripts that a robot may request with one word; see :func:`load_named_script`."""
    paths = [path for folder in _folders(beside) for path in folder.glob(f"*{_SUFFIX}")]
    fit = {path.stem for path in paths if _WORD.fullmatch(path.stem) and _has_steps(path)}
    return sorted(fit)


def _folders(beside: Path | None) -> Iterator[Path]:
    if beside is not None:
        yield beside.parent
    yield config_dir() / "scripts"


_State = tuple[int, int, int, int]
"""State of a file, by which a change is detected: inode, mtime (ns), ctime (ns), size (bytes)."""


def _state_inside(path: Path) -> _State | None:
    """Return the state of a file; None for anything else, such as a named pipe or a link out of the folder."""
    try:
        found = path.lstat()
        if stat.S_ISLNK(found.st_mode) and path.resolve().parent == path.parent.resolve():
            found = path.stat()
    except (OSError, ValueError, RuntimeError):  # RuntimeError: a loop of links
        return None
    return (found.st_ino, found.st_mtime_ns, found.st_ctime_ns, found.st_size) if stat.S_ISREG(found.st_mode) else None


def _has_steps(path: Path) -> bool:
    state = _state_inside(path)
    return state is not None and _has_steps_cached(path, state)


@lru_cache(maxsize=512)
def _has_steps_cached(path: Path, _state: _State) -> bool:
    """Whether a file is a script, cached for a state of the file."""
    try:
        return "steps" in read_toml(path)
    except (OSError, ValueError):
        return False


@lru_cache(maxsize=16)
def _load_cached(path: Path, _state: _State, parameters: Parameters, vocabulary: Vocabulary | None) -> Script:
    """Read a script, cached for a state of its file."""
    return _load(path, parameters, vocabulary)


def _load(path: Path, parameters: Parameters, vocabulary: Vocabulary | None) -> Script:
    vocabulary = vocabulary or Vocabulary.load(parameters)
    grammar = Grammar(parameters, lambda name: vocabulary[name].name, scripted=True)
    file = load(path, _File, lambda file: _read_steps(file, grammar)[1])
    steps, _ = _read_steps(file, grammar)
    name = path.stem if file.name is None else file.name
    sound = None if file.sound is None else path.parent / file.sound
    return Script(tuple(steps), file.loop_s, file.frames_hz, name, file.marks, sound)


class Wave:
    """Moves every parameter at its own rate inside its range, for measurements under load."""

    def __init__(self, parameters: Parameters) -> None:
        index = np.arange(len(parameters))
        self._rate = 2 * math.pi * (0.25 + 0.5 * np.modf(index * 0.6180339887)[0])
        self._phase = 2 * math.pi * np.modf(index * 0.7548776662)[0]
        self._middle = np.where(parameters.low < 0, 0.0, 0.25)
        self._swing = np.where(parameters.low < 0, 0.4, 0.25)

    def at(self, time_s: float) -> Floats:
        """Return the values (P,) at a time; every parameter changes with time."""
        values: Floats = self._middle - self._swing * np.cos(self._rate * time_s + self._phase)
        return values
