"""Map shape names of other heads to ARKit's 52.

Names are read by :mod:`surface.fit.source.naming.wordings`; a user's own table comes before it::

    [names]
    "MyHead_grin_links" = "mouthSmileLeft"

Where a mesh has no shape for a parameter, a vowel, a viseme or a mood of the whole face may stand in for it: the table
is at the end of ``presets.toml``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from surface.base import files
from surface.base.errors import FitError
from surface.fit.source.naming.wordings import is_junk, names_table, presets_table, read_name, read_preset, sums
from surface.head.model.parameters import SHAPES

EXAMPLE = 'a table looks like: [names] "My_Smile_L" = "mouthSmileLeft"'
MIXED_FRACTION = 0.25  # of another shape: a shape that contains more of it is a mixture of both
_Found = dict[str, dict[str, int]]


@dataclass(frozen=True)
class Source:
    """One shape of the mesh that adds to a parameter.

    side : which half of it: "Left", "Right", or "" for all of it.
    region : where: "mouth", "eyes", "brows", or "" for everywhere.
    less : a shape whose share in this one is taken away; -1 for none.
    """

    index: int
    side: str = ""
    region: str = ""
    less: int = -1


@dataclass(frozen=True)
class NameMap:
    """Which shapes of a mesh make which of ARKit's 52.

    sources : parameter -> the shapes that add up to it, in the order of ARKit's list.
    missing : parameters that no shape makes; left_out : shapes of the mesh that are not understood.
    empty : shapes that move nothing; they count as missing.
    stand_ins : parameters made from a vowel, a viseme or a mood.
    presets : such shapes that are understood but not needed, since their parameters have shapes of their own.
    spare : shapes that mean what another shape already does.
    mouth, eyes : shapes that show where these are; empty where no shape does.
    filled : parameters whose shapes are not the mesh's own, with the name of the head that they come from.
    """

    sources: dict[str, list[Source]]
    missing: tuple[str, ...]
    left_out: tuple[str, ...]
    empty: tuple[str, ...] = ()
    stand_ins: tuple[str, ...] = ()
    presets: tuple[str, ...] = ()
    spare: tuple[str, ...] = ()
    mouth: tuple[int, ...] = ()
    eyes: tuple[int, ...] = ()
    filled: dict[str, str] = field(default_factory=dict)

    def made_of(self, names: tuple[str, ...]) -> dict[str, list[str]]:
        """For each parameter the names of the shapes that it is made of."""
        own = {p: [names[s.index] for s in every] for p, every in self.sources.items()}
        return own | {p: [f"{p} of the head {head!r}"] for p, head in self.filled.items()}

    def filled_up(self, parameters: tuple[str, ...], start: int, head: str) -> NameMap:
        """The map with further shapes of the mesh for parameters, from index ``start`` on, that come from a head."""
        added = {p: [Source(start + k)] for k, p in enumerate(parameters)}
        every = {s: (added | self.sources)[s] for s in SHAPES if s in added or s in self.sources}
        mouth, eyes = _anchors(every)
        missing = tuple(p for p in self.missing if p not in added)
        return replace(
            self,
            sources=every,
            missing=missing,
            mouth=mouth,
            eyes=eyes,
            filled=self.filled | dict.fromkeys(added, head),
        )


@dataclass
class _Read:
    """What the names say: parameters by key and side, presets by key, and names of neither."""

    exact: dict[str, int]
    found: _Found = field(default_factory=dict)
    presets: dict[str, int] = field(default_factory=dict)
    meant: dict[int, str] = field(default_factory=dict)
    moods: set[int] = field(default_factory=set)


def sources_of(names: tuple[str, ...]) -> dict[str, list[int]]:
    """For each of ARKit's 52 that the mesh has as a whole: indices of the mesh's shapes that add up to it."""
    found = map_names(names).sources
    return {n: [s.index for s in every] for n, every in found.items() if all(s == Source(s.index) for s in every)}


def map_names(
    names: tuple[str, ...], own: Mapping[str, str] | None = None, *, empty: Collection[int] = (),
    other: Mapping[int, Iterable[str]] | None = None, share: Callable[[int, int], float] = lambda shape, of: 0.0,
) -> NameMap:  # fmt: skip
    """Find ARKit's 52 among shape names.

    own : maps further names and comes first. empty : shapes that move nothing. other : further names of shapes, that
        count where their own are not understood. share : how much of another shape is in one, 0..1.
    """
    read = _read_all(names, own or {}, empty, other or {})
    every = {s: [Source(read.exact[s])] if s in read.exact else _made(s, read.found) for s in SHAPES}
    stand_ins = _stand_ins(every, read.presets, share)
    every |= stand_ins
    sources = {shape: made for shape, made in every.items() if made}
    used = {s.index for made in sources.values() for s in made}
    rest = [i for i in range(len(names)) if i not in used and i not in empty]
    spare = [i for i in rest if read.meant.get(i) in {s.removesuffix("Left").removesuffix("Right") for s in sources}]
    unread = [i for i in rest if i not in read.moods and i not in spare and not is_junk(names[i])]

    def named(indices: Iterable[int]) -> tuple[str, ...]:
        return tuple(names[i] for i in indices)

    return NameMap(
        sources, tuple(s for s in SHAPES if s not in sources), named(unread), named(sorted(empty)), tuple(stand_ins),
        named(i for i in rest if i in read.moods), named(spare), *_anchors(sources),
    )  # fmt: skip


def _read_all(
    names: tuple[str, ...], own: Mapping[str, str], empty: Collection[int], other: Mapping[int, Iterable[str]]
) -> _Read:
    """Every name that is not empty; ARKit's own words come before other ways to say it, presets in the file's order."""
    start = len(_common(names))
    exact = {n: i for i, n in enumerate(names) if n in SHAPES and n not in own and i not in empty}
    exact |= {own[n]: i for i, n in enumerate(names) if n in own and i not in empty}
    out = _Read(exact)
    rest = [i for i, n in enumerate(names) if n not in own and i not in empty]
    meanings = []
    for i in rest:
        ways = [names[i][start:], names[i], *other.get(i, ())]
        meaning = next((m for way in ways if (m := read_name(way))), None)
        if meaning is not None:
            meanings.append((i, meaning))
        elif (preset := next((p for way in ways if (p := read_preset(way))), None)) is not None:
            out.presets.setdefault(preset, i)
            out.moods.add(i)
    for i, meaning in sorted(meanings, key=lambda x: not x[1].plain):
        out.found.setdefault(meaning.key, {}).setdefault(meaning.side, i)
        out.meant[i] = meaning.key.partition("/")[0]
    return out


def _made(shape: str, found: _Found) -> list[Source]:
    """Sources of a parameter: one shape, two halves, a half of a shape for both sides, or several that add up."""
    side = next((s for s in ("Left", "Right") if shape.endswith(s)), "")
    key = shape.removesuffix(side)
    by_side = found.get(key, {})
    if side in by_side:
        return [Source(by_side[side])]
    if not side and len(by_side) == 2:
        return [Source(by_side["Left"]), Source(by_side["Right"])]
    if side and "" in by_side and key in names_table()["sided"]:
        return [Source(by_side[""], side)]
    for group in sums().get(shape, []):
        parts = [_whole(found.get(part, {})) for part in group]
        if all(parts):
            return [s for part in parts for s in part]
    return []


def _whole(by_side: dict[str, int]) -> list[Source]:
    """A shape for both sides, or its two halves; nothing where one is missing."""
    if "" in by_side:
        return [Source(by_side[""])]
    return [Source(i) for i in by_side.values()] if len(by_side) == 2 else []


def _stand_ins(
    every: Mapping[str, list[Source]], presets: Mapping[str, int], share: Callable[[int, int], float]
) -> dict[str, list[Source]]:  # fmt: skip
    """Sources of parameters without shapes, by the first row of the table that the mesh has a preset for.

    A row whose shape has much of what is to be taken away comes last: a smile that opens the mouth wide is little of a
    smile without that.
    """
    found: dict[str, list[tuple[bool, int, Source]]] = {}
    for order, row in enumerate(presets_table()["stand_in"]):
        index, less = presets.get(row["from"]), presets.get(row.get("less", ""), -1)
        if index is None:
            continue
        much = less >= 0 and share(index, less) > MIXED_FRACTION
        for shape, side in _sides_of(row["parameter"]):
            if not every[shape]:
                source = Source(index, side, row.get("region", ""), less)
                found.setdefault(shape, []).append((much, order, source))
    return {shape: [min(rows, key=lambda row: row[:2])[2]] for shape, rows in found.items()}


def _sides_of(key: str) -> list[tuple[str, str]]:
    """The parameters that a key stands for, each with the side that it is cut to."""
    if key in names_table()["sided"]:
        return [(f"{key}{side}", side) for side in ("Left", "Right")]
    side = next((s for s in ("Left", "Right") if key.endswith(s)), "")
    return [(key, side)]


def _anchors(sources: Mapping[str, list[Source]]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Shapes that move the mouth, and shapes that move the lids."""
    mouth = sources.get("jawOpen") or sources.get("mouthFunnel") or sources.get("mouthPucker") or []
    eyes = {s.index for n in ("eyeBlinkLeft", "eyeBlinkRight") for s in sources.get(n, [])}
    return tuple(s.index for s in mouth), tuple(sorted(eyes))


def _common(names: tuple[str, ...]) -> str:
    """What all names begin with, up to a separator."""
    low, high = (min(names), max(names)) if len(names) > 3 else ("", "")
    same = next((i for i, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), 0)
    return low[: max(low[:same].rfind(c) for c in "_. :|-") + 1]


def read_names(path: Path) -> dict[str, str]:
    """A user's table of names.

    Raises FitError: the file cannot be read, or maps to something that is not one of ARKit's 52.
    """
    with files.reading(path, FitError, hint=EXAMPLE):
        table = files.read_toml(path).get("names")
    if not isinstance(table, dict):
        raise FitError(f"{path}: there is no table [names]", hint=EXAMPLE)
    for name, shape in table.items():
        if not isinstance(shape, str) or shape not in SHAPES:
            raise FitError(f"{path}: names.{name}: {shape!r} is not one of ARKit's 52", hint="for example jawOpen")
    return table
