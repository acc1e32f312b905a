"""Keyframes on a timeline, with easing between them; a timeline becomes a show (a script) and is read back from it.

Independent of any window. A timeline is never changed: every edit returns another, so that undo keeps the earlier ones.
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
_LEAST = 0.002
_MOST_KEYS, _LONGEST_S = 1000, 3600.0


@dataclass(frozen=True)
class Key:
    """A face at a moment.

    at_s : when. values : parameters by name; the others are 0 there. ease : how it is reached from the key before.
    name : for people, as of the expression that it is.
    """

    at_s: float
    values: Mapping[str, float]
    ease: Ease = "smooth"
    name: str = ""


@dataclass(frozen=True)
class Timeline:
    """Keys in rising time, and marks: names of moments (s). sound : a WAV file that plays with it."""

    keys: tuple[Key, ...] = ()
    marks: Mapping[str, float] = field(default_factory=dict)
    sound: Path | None = None

    @property
    def length_s(self) -> float:
        """When the last key is."""
        return self.keys[-1].at_s if self.keys else 0.0

    def with_key(self, key: Key) -> Timeline:
        """With another key, in place of one at the same moment. Raises ParameterError: no time from 0 to an hour."""
        if not 0.0 <= key.at_s <= _LONGEST_S:
            raise ParameterError(
                f"a key is from 0 to {_LONGEST_S:g} s, not at {key.at_s:g}", hint="move the line first"
            )
        kept = [each for each in self.keys if abs(each.at_s - key.at_s) > 1e-6]
        if len(kept) >= _MOST_KEYS:
            raise ParameterError(f"a timeline has {_MOST_KEYS} keys at most", hint="begin another show")
        return replace(self, keys=tuple(sorted([*kept, key], key=lambda each: each.at_s)))

    def without_key(self, number: int) -> Timeline:
        """Without the key of a number."""
        return replace(self, keys=self.keys[:number] + self.keys[number + 1 :])

    def moved(self, number: int, at_s: float) -> Timeline:
        """With a key at another moment."""
        return self.without_key(number).with_key(replace(self.keys[number], at_s=min(max(at_s, 0.0), _LONGEST_S)))

    def eased(self, number: int, ease: Ease) -> Timeline:
        """With a key that is reached in another way."""
        return self.without_key(number).with_key(replace(self.keys[number], ease=ease))

    def with_mark(self, name: str, at_s: float | None) -> Timeline:
        """With a mark, or without it for None. Raises ParameterError: the name is empty."""
        if not name.strip():
            raise ParameterError("a mark needs a name", hint="as: hello")
        marks = {key: value for key, value in self.marks.items() if key != name}
        return replace(self, marks=marks if at_s is None else {**marks, name: round(max(at_s, 0.0), 3)})

    def at(self, time_s: float, parameters: Parameters) -> Floats:
        """(P,) the face at a moment; before the first and after the last key it is theirs."""
        if not self.keys:
            return parameters.neutral()
        after = bisect.bisect_right([key.at_s for key in self.keys], time_s)
        if after == 0 or after == len(self.keys):
            return _face(self.keys[min(after, len(self.keys) - 1)], parameters)
        first, second = self.keys[after - 1], self.keys[after]
        share = eased((time_s - first.at_s) / (second.at_s - first.at_s), second.ease)
        return (1.0 - share) * _face(first, parameters) + share * _face(second, parameters)


def eased(share: float, ease: Ease) -> float:
    """The way that is done after a share 0..1 of the time."""
    ways = {
        "linear": share,
        "smooth": share * share * (3.0 - 2.0 * share),
        "in": share * share,
        "out": share * (2.0 - share),
        "hold": 0.0 if share < 1.0 else 1.0,
    }
    return ways[ease]


def key_of_face(at_s: float, face: Floats, parameters: Parameters, ease: Ease = "smooth", name: str = "") -> Key:
    """A key of the face ``face`` (P,); values below 0.002 are left out."""
    there = np.flatnonzero(np.abs(face) >= _LEAST)
    return Key(round(at_s, 3), {parameters.names[i]: round(float(face[i]), 3) for i in there}, ease, name)


def steps_of(timeline: Timeline, parameters: Parameters, rate_hz: float = RATE_HZ) -> list[str]:
    """The steps of a script that plays a timeline: ``SET`` lines of what changes, at ``rate_hz`` while it does.

    The first sets every parameter that any key has, so that a show which loops begins alike.
    """
    used = [i for i, name in enumerate(parameters.names) if any(name in key.values for key in timeline.keys)]
    count = int(np.floor(timeline.length_s * rate_hz + 1e-9))
    times = np.union1d(np.round(np.arange(count + 1) / rate_hz, 3), np.round([k.at_s for k in timeline.keys], 3))
    steps: list[str] = []
    written = np.full(len(parameters), np.nan)
    for time_s in times if used else ():
        face = timeline.at(float(time_s), parameters)
        is_key = any(abs(key.at_s - time_s) < 1e-6 for key in timeline.keys)
        least = 1e-4 if is_key else _LEAST
        changed = [i for i in used if not abs(face[i] - written[i]) < least]
        if changed:
            written[changed] = face[changed]
            words = " ".join(f"{parameters.names[i]} {face[i]:.4g}" for i in changed)
            steps.append(f"{time_s:.3f} SET {words}")
    return steps


class _KeyTable(Settings):
    at_s: Annotated[Number, Field(ge=0, le=_LONGEST_S)]
    ease: Ease = "smooth"
    name: str = ""
    values: dict[str, Number] = {}


class _File(Settings, extra="ignore"):
    """What a timeline needs of a script that it was saved as."""

    marks: dict[str, Number] = {}
    sound: str | None = None
    keys: Annotated[list[_KeyTable], Field(max_length=_MOST_KEYS)] = []


def save_show(
    path: Path, timeline: Timeline, parameters: Parameters, vocabulary: Vocabulary | None = None, *, loop: bool = False
) -> None:
    """Write a timeline as a script, which plays it, with its keys, which :func:`load_timeline` reads.

    Raises ParameterError: there is no key, or its sound is not in the folder. ControllerError: the file cannot be
    written, or could not be read again.
    """
    steps = steps_of(timeline, parameters)
    if not steps:
        raise ParameterError("the timeline has no keys that move anything", hint="add a key first")
    table: dict[str, Any] = {"name": path.stem, "description": "made on a timeline; edit its keys there"}
    if loop:
        table["loop_s"] = round(timeline.length_s + 1.0 / RATE_HZ, 3)
    if timeline.sound is not None:
        table["sound"] = _beside(timeline.sound, path)
    table |= {"steps": steps, "marks": dict(timeline.marks)}
    table["keys"] = [
        {"at_s": key.at_s, "ease": key.ease, "name": key.name, "values": dict(key.values)} for key in timeline.keys
    ]
    with replacing(path) as temporary:
        temporary.write_text(tomli_w.dumps(table), encoding="utf-8")
        load_script(str(temporary), parameters, vocabulary)


def load_timeline(path: Path, parameters: Parameters) -> Timeline:
    """The timeline of a script that was saved from one; without keys for any other script.

    Raises ConfigError: it cannot be read, or a key names no parameter.
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


def _beside(sound: Path, show: Path) -> str:
    """A sound as a show names it: in its folder or below. Raises ParameterError: it is elsewhere."""
    folder = show.parent.resolve()
    if not sound.resolve().is_relative_to(folder):
        raise ParameterError(f"{sound}: a show's sound lies beside it", hint=f"copy it to {folder}")
    return sound.resolve().relative_to(folder).as_posix()


def _face(key: Key, parameters: Parameters) -> Floats:
    face = parameters.neutral()
    for name, value in key.values.items():
        face[parameters.index(name)] = value
    return np.clip(face, parameters.low, parameters.high)
