"""Say in words what became of the shapes of a mesh: made from presets, empty, doubled, not needed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from surface.fit.source.names import NameMap, Source

MAX_LISTED = 12  # names of one list that are written out


def name_notes(names: tuple[str, ...], mapped: NameMap, other: Mapping[int, Iterable[str]] | None = None) -> list[str]:
    """Notes about shapes with these names, and with other names that the file gives them, for report and terminal."""
    titles = [_title(name, (other or {}).get(k, ())) for k, name in enumerate(names)]
    whole = bool(mapped.mouth and mapped.eyes)
    plain = not (mapped.stand_ins or mapped.presets or mapped.spare or mapped.empty or mapped.left_out)
    notes = [] if plain else [_count(names, mapped)]
    notes += [_stand_in(p, mapped.sources[p], titles, whole) for p in mapped.stand_ins if not _has_left(p, mapped)]
    for what, every in (
        ("understood, and made from parameters", mapped.presets),
        ("not taken, another shape means the same", mapped.spare),
        ("empty, they move nothing", mapped.empty),
    ):
        notes += [f"{what}: {listed(every)}"] if every else []
    return notes


def _count(names: tuple[str, ...], mapped: NameMap) -> str:
    """How many shapes there are of each sort, such as: 67 shapes: 52 make 52 parameters, 14 presets, 1 empty."""
    used = {s.index for every in mapped.sources.values() for s in every}
    sorts = (
        (len(mapped.presets), "presets and visemes"), (len(mapped.spare), "doubled"), (len(mapped.empty), "empty"),
        (len(mapped.left_out), "not understood"),
    )  # fmt: skip
    rest = "".join(f", {count} {what}" for count, what in sorts if count)
    return f"{len(names)} shapes: {len(used)} make {len(mapped.sources)} parameters{rest}"


def _title(name: str, other: Iterable[str]) -> str:
    more = [o for o in other if o != name]
    return f"{more[0]!r} ({name})" if more else repr(name)


def _has_left(parameter: str, mapped: NameMap) -> bool:
    """Whether this is a right side that the note on the left one also covers."""
    left = parameter.removesuffix("Right") + "Left"
    if not parameter.endswith("Right") or left not in mapped.stand_ins:
        return False
    return [s.index for s in mapped.sources[left]] == [s.index for s in mapped.sources[parameter]]


def _stand_in(parameter: str, sources: list[Source], titles: list[str], cut: bool) -> str:
    what = " and ".join(_one(s, titles, cut) for s in sources)
    if sources[0].side == "Left" and parameter.endswith("Left") and "Look" not in parameter:
        return f"{parameter} and Right are made from the halves of {what}"
    return f"{parameter} is made from {f'the {sources[0].side.lower()} half of ' if sources[0].side else ''}{what}"


def _one(source: Source, titles: list[str], cut: bool) -> str:
    """One source in words, such as: 'Joy' about the mouth, less its share of 'A'."""
    where = f" about the {source.region}" if source.region and cut else ""
    return titles[source.index] + where + (f", less its share of {titles[source.less]}" if source.less >= 0 else "")


def listed(every: tuple[str, ...]) -> str:
    """Names in one line; of very many the first ones, and how many more."""
    more = f" and {len(every) - MAX_LISTED} more" if len(every) > MAX_LISTED else ""
    return ", ".join(every[:MAX_LISTED]) + more
