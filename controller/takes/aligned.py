"""Reads speech with timed sounds, words or sentences: TextGrid of Praat and the Montreal Forced Aligner, and aeneas.

If a file has the times of sounds, they are used. If it has only those of words or sentences, the sounds are guessed
from the letters and spread over the time.

In a TextGrid (Praat's manual, "TextGrid file formats") only free-standing numbers, strings in double quotes and flags
in angle brackets count, in their order; everything else is a comment. So the long and the short form are read alike.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.base.errors import ParameterError, TakeError
from controller.base.parameters import Floats, Parameters
from controller.takes.livelink import Take
from controller.takes.speech import Cue, speech_take
from controller.vocabulary.visemes import Visemes
from surface.base import files

_TEXTGRID = "save it in Praat as a text file or a short text file; mfa align writes TextGrids, too"
_AENEAS = "aeneas writes it where os_task_file_format=json is in the configuration of its task"

_TOKEN = re.compile(r'"((?:[^"]|"")*)"|(?<!\S)(<\w+>|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?!\S)|(?<!\S)!.*')
_SOUND_TIERS = re.compile(r"(?:.* - )?(?:phon(?:e|eme|emic|etic)?s?|sounds?|segments?|visemes?|ipa|mau|kan-mau)", re.I)
_WORD_TIERS = re.compile(r"(?:.* - )?(?:words?|ort(?:-mau)?|text|sentences?|utterances?)", re.I)
_SILENT = {"", "sil", "sp", "spn", "nsn", "pau", "h#", "#", "_", "*", "noise", "<eps>", "<sil>", "<p:>", "<unk>"}
_MAX_FILE_BYTES = 16 << 20


@dataclass(frozen=True)
class Interval:
    """A label with its start and end (s)."""

    start_s: float
    end_s: float
    text: str


def is_aeneas(start: bytes) -> bool:
    """Whether a file that begins with these bytes is the output of aeneas."""
    return b'"fragments"' in start


def textgrid_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from a TextGrid: from its tier of sounds, or else from one of words. Raises TakeError."""
    visemes = Visemes.load(parameters)
    try:
        tiers = dict(_tiers(path))
    except ValueError as error:
        raise TakeError(f"{path}: not a TextGrid: {error}", hint=_TEXTGRID) from error
    cues, end_s = _cues_of_tiers(path, tiers, visemes)
    return speech_take(path.name, cues, end_s, parameters, visemes)


def sounds_of(path: Path, visemes: Visemes) -> list[tuple[float, float, str, Floats]]:
    """Return start (s), end (s), label and weights (n,) of every sound in a TextGrid's tier of sounds, without silence.

    Raises TakeError: there is no such tier, or a sound is unknown.
    """
    try:
        tiers = dict(_tiers(path))
        sounds = _longest_tier({name: tier for name, tier in tiers.items() if _SOUND_TIERS.fullmatch(name.strip())})
        spoken = [each for each in sounds or [] if _is_sound(each)]
        if not spoken:
            raise ValueError("no tier of sounds")
        weights = visemes.sounds([each.text for each in spoken], guess=True)
    except (ValueError, ParameterError) as error:
        raise TakeError(f"{path}: {error}", hint=_TEXTGRID) from error
    return [(each.start_s, each.end_s, each.text, row) for each, row in zip(spoken, weights, strict=True)]


def aeneas_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from the fragments of aeneas, by the letters of their lines. Raises TakeError."""
    visemes = Visemes.load(parameters)
    with files.reading(path, TakeError, hint=_AENEAS):
        fragments = [_fragment(f"fragments[{i}]", each) for i, each in enumerate(_fragments(path))]
    cues, end_s = _cues_of_words(fragments, visemes)
    return speech_take(path.name, cues, end_s, parameters, visemes)


def _fragments(path: Path) -> list[Any]:
    found = files.read_json(path, _MAX_FILE_BYTES)
    listed = found.get("fragments") if isinstance(found, dict) else None
    if not isinstance(listed, list):
        raise ValueError("there is no list fragments")
    return listed


def _fragment(where: str, found: Any) -> Interval:
    """Parse a fragment of aeneas, whose times are strings. Raises ValueError."""
    if not isinstance(found, dict):
        raise ValueError(f"{where} must be an object")
    lines = found.get("lines", [])
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        raise ValueError(f"{where}.lines must be a list of texts")
    times = []
    for key in ("begin", "end"):
        try:
            times.append(float(found[key]))
        except (KeyError, TypeError, ValueError):
            raise ValueError(f"{where}.{key} must be a time in seconds") from None
    return _interval(where, times[0], times[1], " ".join(lines))


def _interval(where: str, start_s: float, end_s: float, text: str) -> Interval:
    if not 0.0 <= start_s <= end_s < math.inf:
        raise ValueError(f"{where}: its times are {start_s:g} to {end_s:g} s")
    return Interval(start_s, end_s, text.strip())


def _tiers(path: Path) -> Iterator[tuple[str, list[Interval]]]:
    """Yield the name and intervals of each tier; a point lasts until the next one.

    Raises ValueError: it is not a TextGrid. TakeError: the file cannot be read.
    """
    with files.reading(path, TakeError, hint=_TEXTGRID):
        data = files.read_file(path, _MAX_FILE_BYTES)
    if data.startswith(b"ooBinaryFile"):
        raise ValueError("it is a binary file")
    tokens = _Tokens(_decode(data))
    if tokens.text() not in ("ooTextFile", "ooTextFile short") or tokens.text() != "TextGrid":
        raise ValueError('it begins without "ooTextFile" and "TextGrid"')
    tokens.number(), tokens.number()
    if tokens.flag() != "<exists>":
        raise ValueError("it has no tiers")
    for k in range(1, tokens.count() + 1):
        kind, name = tokens.text(), tokens.text()
        end_s = (tokens.number(), tokens.number())[1]
        count = tokens.count()
        if kind == "IntervalTier":
            named = (f"tier {k}, interval {i}" for i in range(1, count + 1))
            yield name, [_interval(each, tokens.time(), tokens.time(), tokens.text()) for each in named]
        elif kind == "TextTier":
            points = [(tokens.time(), tokens.text()) for _ in range(count)]
            ends = [*(start for start, _ in points[1:]), end_s]
            pairs = zip(points, ends, strict=False)
            yield name, [_interval(f"tier {k}", start, end, text) for (start, text), end in pairs]
        else:
            raise ValueError(f"tier {k} is a {kind!r}, neither IntervalTier nor TextTier")


def _decode(data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            return data.decode("utf-16")
        except UnicodeDecodeError as error:
            raise ValueError(f"its UTF-16 is damaged at byte {error.start}") from error
    return files.decode(data)


class _Tokens:
    """Reads the tokens of a TextGrid in order; each method raises ValueError if the next token is of another kind."""

    def __init__(self, text: str) -> None:
        self._found = (match for match in _TOKEN.finditer(text) if match[1] is not None or match[2] is not None)

    def _next(self) -> re.Match[str]:
        found = next(self._found, None)
        if found is None:
            raise ValueError("it ends too early")
        return found

    def text(self) -> str:
        """Read a string."""
        found = self._next()
        if found[1] is None:
            raise ValueError(f"{found[2]!r} instead of a string")
        return found[1].replace('""', '"')

    def flag(self) -> str:
        """Read a flag, with its angle brackets; for any other token the result is not a flag."""
        return self._next()[2] or ""

    def number(self) -> float:
        """Read a number."""
        found = self._next()
        try:
            return float(found[2])
        except (TypeError, ValueError):
            raise ValueError(f"{found[0][:40]!r} instead of a number") from None

    def time(self) -> float:
        """Read a time (s); one that rounding has made slightly negative becomes 0."""
        found = self.number()
        return 0.0 if -1e-6 < found < 0.0 else found

    def count(self) -> int:
        """Read the number of items that follow."""
        found = self.number()
        if not 0 <= found < 1e7 or found != int(found):
            raise ValueError(f"{found:g} is not a count")
        return int(found)


def _cues_of_tiers(path: Path, tiers: dict[str, list[Interval]], visemes: Visemes) -> tuple[list[Cue], float]:
    """Return the cues of the tier of sounds, or else of the tier of words, and the end of the last cue (s)."""
    spoken = {name: tier for name, tier in tiers.items() if any(_is_sound(each) for each in tier)}
    if not spoken:
        raise TakeError(f"{path}: no tier has any text", hint=_TEXTGRID)
    sounds = _longest_tier({name: tier for name, tier in spoken.items() if _SOUND_TIERS.fullmatch(name.strip())})
    words = _longest_tier({name: tier for name, tier in spoken.items() if _WORD_TIERS.fullmatch(name.strip())})
    if sounds is not None:
        try:
            return _cues_of_sounds(sounds, visemes)
        except ParameterError as error:
            raise TakeError(f"{path}: {error}", hint=error.hint) from error
    for tier in [] if words is not None else sorted(spoken.values(), key=len, reverse=True):
        try:
            return _cues_of_sounds(tier, visemes)
        except ParameterError:
            continue
    return _cues_of_words(words or max(spoken.values(), key=len), visemes)


def _longest_tier(tiers: dict[str, list[Interval]]) -> list[Interval] | None:
    return max(tiers.values(), key=len, default=None)


def _is_sound(interval: Interval) -> bool:
    return interval.text.lower() not in _SILENT


def _cues_of_sounds(tier: Sequence[Interval], visemes: Visemes) -> tuple[list[Cue], float]:
    """Return a cue for each sound, with silence in the gaps, and the end (s). Raises ParameterError: unknown sound."""
    tier = sorted(tier, key=lambda each: each.start_s)
    weights = iter(visemes.sounds([each.text for each in tier if _is_sound(each)], guess=True))
    rest, cues, end_s = visemes.weights(visemes.names[0]), list[Cue](), 0.0
    for each in tier:
        if each.start_s > end_s + 1e-3:
            cues.append(Cue(end_s, rest))
        cues.append(Cue(each.start_s, next(weights) if _is_sound(each) else rest))
        end_s = max(end_s, each.end_s)
    return cues, end_s


def _cues_of_words(tier: Sequence[Interval], visemes: Visemes) -> tuple[list[Cue], float]:
    """Return cues for the letters of each label, spread over its time by the usual lengths of their visemes."""
    rest, cues, end_s = visemes.weights(visemes.names[0]), list[Cue](), 0.0
    for each in sorted(tier, key=lambda each: each.start_s):
        if each.start_s > end_s + 1e-3:
            cues.append(Cue(end_s, rest))
        sounds = visemes.spell(each.text) if _is_sound(each) else rest[None]
        lengths = sounds @ visemes.duration
        step_s = (each.end_s - each.start_s) / max(float(lengths.sum()), 1e-9)
        starts = each.start_s + step_s * (lengths.cumsum() - lengths)
        cues += [Cue(float(start), sound) for start, sound in zip(starts, sounds, strict=True)]
        end_s = max(end_s, each.end_s)
    return cues, end_s
