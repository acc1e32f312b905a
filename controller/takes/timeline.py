"""Defines timelines: key frames with easing between them, which are saved as a show (a script) and loaded from it.

This module does not depend on any window. Timelines are immutable: every edit returns a new one, which makes undo
possible.
"""

from __future__ import annotations

import bisect
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import tomli_w
from pydantic import Field

from controller.base.config import Number, Settings, load
from controller.base.errors import ParameterError
from controller.base.files import replacing
from controller.base.parameters import Floats, Parameters
from controller.links.line.script import load_script
from controller.vocabulary.vocabulary import Vocabulary

Ease = Literal["linear", "smooth", "in", "out", "hold"]
EASES: tuple[Ease, ...] = get_args(Ease)
RATE_HZ = 25.0
_MIN_CHANGE = 0.002  # smaller values and changes are not written
_MAX_KEYS, _MAX_LENGTH_S = 1000, 3600.0


@dataclass(frozen=True)
class Key:
    """A face at a moment.

    at_s : time of the key. values : parameters by name; the others are 0. ease : easing from the previous key to this
    one. name : for people, such as that of the expression.
    """

    at_s: float
    values: Mapping[str, float]
    ease: Ease = "smooth"
    name: str = ""


@dataclass(frozen=True)
class Timeline:
    """Keys sorted by time. marks : times (s) by name. sound : a WAV file that plays with the timeline."""

    keys: tuple[Key, ...] = ()
    marks: Mapping[str, float] = field(default_factory=dict)
    sound: Path | None = None

    @property
    def length_s(self) -> float:
        """Time of the last key; 0 without keys."""
        return self.keys[-1].at_s if self.keys else 0.0

    def with_key(self, key: Key) -> Timeline:
        """Return a timeline with another key, which replaces a key at the same time.

        Raises ParameterError: its time is not from 0 to an hour, or there are too many keys.
        """
        if not 0.0 <= key.at_s <= _MAX_LENGTH_S:
            raise ParameterError(
                f"a key is from 0 to {_MAX_LENGTH_S:g} s, not at {key.at_s:g}", hint="move the line first"
            )
        kept = [each for each in self.keys if abs(each.at_s - key.at_s) > 1e-6]
        if len(kept) >= _MAX_KEYS:
            raise ParameterError(f"a timeline has {_MAX_KEYS} keys at most", hint="begin another show")
        return replace(self, keys=tuple(sorted([*kept, key], key=lambda each: each.at_s)))

    def without_key(self, number: int) -> Timeline:
        """Return a timeline without the key of this index."""
        return replace(self, keys=self.keys[:number] + self.keys[number + 1 :])

    def with_time(self, number: int, at_s: float) -> Timeline:
        """Return a timeline in which the key of this index has another time, clipped to 0..1 hour."""
        return self.without_key(number).with_key(replace(self.keys[number], at_s=min(max(at_s, 0.0), _MAX_LENGTH_S)))

    def with_ease(self, number: int, ease: Ease) -> Timeline:
        """Return a timeline in which the key of this index has another easing."""
        return self.without_key(number).with_key(replace(self.keys[number], ease=ease))

    def with_mark(self, name: str, at_s: float | None) -> Timeline:
        """Return a timeline with a mark at a time; ``at_s`` None: without that mark. Raises ParameterError: no name."""
        if not name.strip():
            raise ParameterError("a mark needs a name", hint="for example: hello")
        marks = {key: value for key, value in self.marks.items() if key != name}
        return replace(self, marks=marks if at_s is None else {**marks, name: round(max(at_s, 0.0), 3)})

    def at(self, time_s: float, parameters: Parameters) -> Floats:
        """Return the face (P,) at a time; before the first key and after the last one it is that of the key."""
        if not self.keys:
            return parameters.neutral()
        after = bisect.bisect_right([key.at_s for key in self.keys], time_s)
        if after == 0 or after == len(self.keys):
            return _face(self.keys[min(after, len(self.keys) - 1)], parameters)
        first, second = self.keys[after - 1], self.keys[after]
        weight = ease_fraction((time_s - first.at_s) / (second.at_s - first.at_s), second.ease)
        return (1.0 - weight) * _face(first, parameters) + weight * _face(second, parameters)


def ease_fraction(time: float, ease: Ease) -> float:
    """Return the fraction 0..1 of the way that is done after a fraction ``time`` 0..1 of the time."""
    fractions = {
        "linear": time,
        "smooth": time * time * (3.0 - 2.0 * time),
        "in": time * time,
        "out": time * (2.0 - time),
        "hold": 0.0 if time < 1.0 else 1.0,
    }
    return fractions[ease]


def key_of_face(at_s: float, face: Floats, parameters: Parameters, ease: Ease = "smooth", name: str = "") -> Key:
    """Return a key with the values of ``face`` (P,); values below 0.002 are left out."""
    moved = np.flatnonzero(np.abs(face) >= _MIN_CHANGE)
    return Key(round(at_s, 3), {parameters.names[i]: round(float(face[i]), 3) for i in moved}, ease, name)


def steps_of(timeline: Timeline, parameters: Parameters, rate_hz: float = RATE_HZ) -> list[str]:
    """Return the steps of a script that plays a timeline: ``SET`` lines for the changes, ``rate_hz`` times a second.

    The first step sets every parameter of any key, so that every repetition of a looped show begins alike.
    """
    used = [i for i, name in enumerate(parameters.names) if any(name in key.values for key in timeline.keys)]
    count = int(np.floor(timeline.length_s * rate_hz + 1e-9))
    times = np.union1d(np.round(np.arange(count + 1) / rate_hz, 3), np.round([k.at_s for k in timeline.keys], 3))
    steps: list[str] = []
    written = np.full(len(parameters), np.nan)
    for time_s in times if used else ():
        face = timeline.at(float(time_s), parameters)
        is_key = any(abs(key.at_s - time_s) < 1e-6 for key in timeline.keys)
        least = 1e-4 if is_key else _MIN_CHANGE
        changed = [i for i in used if not abs(face[i] - written[i]) < least]
        if changed:
            written[changed] = face[changed]
            words = " ".join(f"{parameters.names[i]} {face[i]:.4g}" for i in changed)
            steps.append(f"{time_s:.3f} SET {words}")
    return steps


class _KeyTable(Settings):
    at_s: Annotated[Number, Field(ge=0, le=_MAX_LENGTH_S)]
    ease: Ease = "smooth"
    name: str = ""
    values: dict[str, Number] = {}


class _File(Settings, extra="ignore"):
    """What a timeline needs of a script that it was saved as."""

    marks: dict[str, Number] = {}
    sound: str | None = None
    keys: Annotated[list[_KeyTable], Field(max_length=_MAX_KEYS)] = []


def save_show(
    path: Path, timeline: Timeline, parameters: Parameters, vocabulary: Vocabulary | None = None, *, loop: bool = False
) -> None:
    """Write a timeline as a script that plays it and that also has its keys, for :func:`load_timeline`.

    Raises ParameterError: no key moves anything, or the sound is not in the script's folder. ControllerError: the file
    cannot be written, or the script cannot be read back.
    """
    steps = steps_of(timeline, parameters)
    if not steps:
        raise ParameterError("the timeline has no keys that move anything", hint="add a key first")
    table: dict[str, Any] = {"name": path.stem, "description": "made on a timeline; edit its keys there"}
    if loop:
        table["loop_s"] = round(timeline.length_s + 1.0 / RATE_HZ, 3)
    if timeline.sound is not None:
        table["sound"] = _relative_to_show(timeline.sound, path)
    table |= {"steps": steps, "marks": dict(timeline.marks)}
    table["keys"] = [
        {"at_s": key.at_s, "ease": key.ease, "name": key.name, "values": dict(key.values)} for key in timeline.keys
    ]
    with replacing(path) as temporary:
        temporary.write_text(tomli_w.dumps(table), encoding="utf-8")
        load_script(str(temporary), parameters, vocabulary)


def load_timeline(path: Path, parameters: Parameters) -> Timeline:
    """Return the timeline from which a script was saved; it has no keys for any other script.

    Raises ConfigError: the file cannot be read, or a key has an unknown parameter.
    """

    def faults(file: _File) -> list[str]:
        known = set(parameters.names)
        return [
            f"keys[{i}].values: unknown parameter {name!r}"
            for i, key in enumerate(file.keys) for name in key.values if name not in known
        ]  # fmt: skip

    file = load(path, _File, faults)
    timeline = Timeline(marks=dict(file.marks), sound=path.parent / file.sound if file.sound else None)
    for key in file.keys:
        timeline = timeline.with_key(Key(key.at_s, dict(key.values), key.ease, key.name))
    return timeline


def _relative_to_show(sound: Path, show: Path) -> str:
    """Return the path of a sound relative to the show's folder. Raises ParameterError: it is not in that folder."""
    folder = show.parent.resolve()
    if not sound.resolve().is_relative_to(folder):
        raise ParameterError(f"{sound}: the sound of a show must be in its folder", hint=f"copy it to {folder}")
    return sound.resolve().relative_to(folder).as_posix()


def _face(key: Key, parameters: Parameters) -> Floats:
    face = parameters.neutral()
    for name, value in key.values.items():
        face[parameters.index(name)] = value
    return np.clip(face, parameters.low, parameters.high)
