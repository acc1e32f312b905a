"""Removes the faults of a configuration table and validates the rest, to find further faults.

A value that does not fit its key is removed; if the table around it is invalid without it, that table is removed, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

Model = TypeVar("Model", bound=BaseModel)
Loc = tuple[str | int, ...]


class PartialConfig(Generic[Model]):
    """The part of a ``table`` that fits ``model`` although the whole does not.

    read : that part as ``model``; None where too little is left.
    """

    def __init__(self, table: dict[str, Any], model: type[Model], error: ValidationError) -> None:
        self._rest, self._removed = _numbered(table), set[str]()
        self.read: Model | None = None
        while self.read is None and self._remove(error):
            try:
                self.read = model.model_validate(self._rest)
            except ValidationError as left:
                error = left

    def relocate(self, faults: Iterable[str]) -> list[str]:
        """Convert the places in faults of :attr:`read` to places in the whole file.

        Faults that name something that was removed are omitted.
        """
        named = re.compile("|".join(re.escape(repr(name)) for name in self._removed) or "(?!)")
        return [_PLACE.sub(self._original_place, fault) for fault in faults if not named.search(fault)]

    def _remove(self, error: ValidationError) -> bool:
        """Remove the values at the faults, or the tables around them; return False if there is nothing to remove."""
        found = {_existing(self._rest, fault["loc"]) for fault in error.errors()} - {()}
        outermost = [loc for loc in found if not any(loc[:depth] in found for depth in range(1, len(loc)))]
        for *parents, last in sorted(outermost, key=_order, reverse=True):  # the last entries of a list first
            around: Any = self._rest
            for part in parents:
                around = around[part]
            value = around.pop(last)
            self._removed |= {*_texts(value), *([str(last)] if isinstance(value, dict) else [])}
        return bool(found)

    def _original_place(self, found: re.Match[str]) -> str:
        """Convert a place in the remaining table, as ``channels[1].map.deg[0]``, to the indices of the whole file."""
        value: Any = self._rest
        parts = re.split(r"([.\[\]]+)", found[0])
        for i, part in enumerate(parts[::2]):
            if isinstance(value, _Numbered) and part.isdigit() and int(part) < len(value):
                parts[2 * i] = str(value.numbers[int(part)])
                value = value[int(part)]
            else:
                value = value.get(part) if isinstance(value, dict) else None
        return "".join(parts)


_PLACE = re.compile(r"[\w-]+(?:\.[\w-]+|\[\d+\])+")


class _Numbered(list[Any]):
    """A list that knows the indices its entries had before others were removed."""

    def __init__(self, values: Iterable[Any]) -> None:
        super().__init__(values)
        self.numbers = list(range(len(self)))

    def pop(self, index: Any = -1) -> Any:
        """Remove an entry and its original index."""
        self.numbers.pop(index)
        return super().pop(index)


def _numbered(value: Any) -> Any:
    """Copy a value with every list as a :class:`_Numbered`."""
    if isinstance(value, dict):
        return {key: _numbered(each) for key, each in value.items()}
    return _Numbered(map(_numbered, value)) if isinstance(value, list) else value


def _order(loc: Loc) -> tuple[tuple[bool, int | str], ...]:
    """Return a sort key of places: names before numbers."""
    return tuple((isinstance(part, int), part) for part in loc)


def _existing(table: Any, loc: Loc) -> Loc:
    """Return the longest prefix of ``loc`` that exists: pydantic adds internal names, and keys that are missing."""
    for depth, part in enumerate(loc):
        keys: Any = table if isinstance(table, dict) else range(len(table)) if isinstance(table, list) else ()
        if part not in keys:
            return loc[:depth]
        table = table[part]
    return loc


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in a value, also in its tables and lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)
