"""Say in words what became of the shapes of a mesh: made from presets, empty, doubled, not needed."""

from __future__ import annotations

from surface.fit.source.names import NameMap, Source

MOST = 12  # names of one list that are written out


def name_notes(names: tuple[str, ...], mapped: NameMap) -> list[str]:
    """Notes about shapes with these names, for the report and the terminal."""
    notes = [f"{p} is made from {_what(names, mapped.sources[p])}" for p in mapped.stand_ins]
    if mapped.presets:
        notes.append(f"understood, and made from parameters: {listed(mapped.presets)}")
    if mapped.spare:
        notes.append(f"not taken, another shape means the same: {listed(mapped.spare)}")
    if mapped.empty:
        notes.append(f"empty, they move nothing: {listed(mapped.empty)}")
    return notes


def _what(names: tuple[str, ...], sources: list[Source]) -> str:
    return " and ".join(_one(names, s) for s in sources)


def _one(names: tuple[str, ...], source: Source) -> str:
    """One source in words, such as: the left half of 'Joy' about the mouth, less its share of 'A'."""
    part = f"the {source.side.lower()} half of {names[source.index]!r}" if source.side else repr(names[source.index])
    where = {"": "", "mouth": " about the mouth", "eyes": " about the eyes", "brows": " about the brows"}[source.region]
    return part + where + (f", less its share of {names[source.less]!r}" if source.less >= 0 else "")


def listed(every: tuple[str, ...]) -> str:
    """Names in one line; of very many the first ones, and how many more."""
    more = f" and {len(every) - MOST} more" if len(every) > MOST else ""
    return ", ".join(every[:MOST]) + more
