"""Reads scripts: timed lines of the line protocol, sent by a simulated robot host or played as a show."""

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
"""Of a script that a robot may ask for: no folder, nothing hidden, nothing that a file system refuses."""

MOST_STEPS = 50_000
"""Timed lines in a script."""
_Seconds = Annotated[Number, Field(ge=0, le=86_400)]


class _File(Settings):
    name: str | None = None
    description: str = ""
    loop_s: _Seconds = 0.0
    frames_hz: Annotated[Number, Field(ge=0, le=200)] = 0.0
    marks: dict[str, _Seconds] = {}
    sound: str | None = None
    steps: Annotated[list[str], Field(max_length=MOST_STEPS)] = []
    keys: Annotated[list[dict[str, Any]], Field(max_length=1000)] = []
    """Of the timeline that the steps were made of; see controller.takes.timeline."""


@dataclass(frozen=True)
class Script:
    """What a robot host sends, or a show plays.

    steps : (time s, line) in rising time.
    loop_s : after how long it begins again; 0 plays it once.
    frames_hz : how often every parameter is sent besides, 0 for never.
    marks : names of moments (s).
    sound : file with what is heard of it, for a film; a run plays no sound.
    """

    steps: tuple[tuple[float, str], ...]
    loop_s: float = 0.0
    frames_hz: float = 0.0
    name: str = ""
    marks: dict[str, float] = field(default_factory=dict)
    sound: Path | None = None


def _read_steps(file: _File, grammar: Grammar) -> tuple[list[tuple[float, str]], list[str]]:
    """The steps of a file, and what is wrong with the others."""
    steps: list[tuple[float, str]] = []
    faults = []
    for i, text in enumerate(file.steps):
        try:
            steps.append(read_step(text, grammar, steps[-1][0] if steps else 0.0))
        except (LineError, ValueError) as error:
            faults.append(f"steps[{i}]: {error} (is {text!r})")
    if file.loop_s and steps and steps[-1][0] > file.loop_s:
        faults.append(f"loop_s: {file.loop_s:g} is before the last step at {steps[-1][0]:g}")
    if file.sound is not None and not _lies_beside(file.sound):
        faults.append(f"sound: must be a file in the folder of the script or below (is {file.sound!r})")
    return steps, faults


def _lies_beside(name: str) -> bool:
    """Whether a file that a script names is no way to other places of this machine."""
    return bool(name) and not Path(name).is_absolute() and ".." not in Path(name).parts and "\0" not in name


def read_step(text: str, grammar: Grammar, earliest_s: float = 0.0) -> tuple[float, str]:
    """Time (s) and line of a step such as ``0.5 EXPR smile``. Raises LineError or ValueError: what is wrong with it."""
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
    """The script at a path or of a name in ``configs/scripts``; the shipped expressions without ``vocabulary``.

    ``beside`` : the file that names it; its folder is searched first.

    Raises ConfigError: it is not there, or wrong; every fault with its key.
    """
    return _load(find_config("scripts", name, beside=beside), parameters, vocabulary)


def load_named_script(
    name: str, parameters: Parameters, vocabulary: Vocabulary | None = None, *, beside: Path | None = None
) -> Script:
    """The script that a robot asks for by name: one in the folder of ``beside`` or in ``configs/scripts``.

    A robot gets no other file: ``name`` is no path, and a link out of these folders is not followed. It may ask at any
    rate, beside commands that must not wait, so a file that has not changed is not read again.

    Raises ConfigError: there is none of that name, or it is wrong; every fault with its key.
    """
    for folder in _folders(beside) if _NAME.fullmatch(name) else ():
        file = folder / f"{name.removesuffix(_SUFFIX)}{_SUFFIX}"
        state = _state_inside(file)
        if state is not None:
            return _kept(file, state, parameters, vocabulary)
    known = sorted(path.stem for path in (config_dir() / "scripts").glob(f"*{_SUFFIX}"))
    message = f"no script {quoted(name)} in the folders of the stage and of configs/scripts{did_you_mean(name, known)}"
    raise ConfigError(message, hint=f"there are {', '.join(known)}")


def script_names(beside: Path | None = None) -> list[str]:
    """Names of the scripts that a robot may ask for with one word, in order; see :func:`load_named_script`."""
    paths = [path for folder in _folders(beside) for path in folder.glob(f"*{_SUFFIX}")]
    fit = {path.stem for path in paths if _WORD.fullmatch(path.stem) and _has_steps(path)}
    return sorted(fit)


def _folders(beside: Path | None) -> Iterator[Path]:
    if beside is not None:
        yield beside.parent
    yield config_dir() / "scripts"


_State = tuple[int, int, int, int]
"""Of a file, so that a change is seen: inode, when its content and when anything changed (ns), size (bytes)."""


def _state_inside(path: Path) -> _State | None:
    """The state of a file; None for anything else, such as a folder, a named pipe, or a link out of the folder."""
    try:
        at = path.lstat()
        if stat.S_ISLNK(at.st_mode) and path.resolve().parent == path.parent.resolve():
            at = path.stat()
    except (OSError, ValueError, RuntimeError):  # RuntimeError: links that lead to each other
        return None
    return (at.st_ino, at.st_mtime_ns, at.st_ctime_ns, at.st_size) if stat.S_ISREG(at.st_mode) else None


def _has_steps(path: Path) -> bool:
    state = _state_inside(path)
    return state is not None and _had_steps(path, state)


@lru_cache(maxsize=512)
def _had_steps(path: Path, _state: _State) -> bool:
    """Whether a file in a given state is a script."""
    try:
        return "steps" in read_toml(path)
    except (OSError, ValueError):
        return False


@lru_cache(maxsize=16)
def _kept(path: Path, _state: _State, parameters: Parameters, vocabulary: Vocabulary | None) -> Script:
    """The script of a file in a given state."""
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
    """Every parameter in motion, each at its own rate inside its range, for measurements under load."""

    def __init__(self, parameters: Parameters) -> None:
        index = np.arange(len(parameters))
        self._rate = 2 * math.pi * (0.25 + 0.5 * np.modf(index * 0.6180339887)[0])
        self._phase = 2 * math.pi * np.modf(index * 0.7548776662)[0]
        self._middle = np.where(parameters.low < 0, 0.0, 0.25)
        self._swing = np.where(parameters.low < 0, 0.4, 0.25)

    def at(self, time_s: float) -> Floats:
        """(P,) values at a time; none rests between two calls at different times."""
        values: Floats = self._middle - self._swing * np.cos(self._rate * time_s + self._phase)
        return values
