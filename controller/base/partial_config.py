"""Validates the part of a configuration table that is left when its faults are removed, to find further faults in it.

A value that does not fit its key is removed; where the table around it cannot be read without it, so is that table.
"""

from __future__ import annotations

import copy
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
        self._kept, self._removed = dict[str, list[int]](), set[str]()
        self.read: Model | None = None
        rest = copy.deepcopy(table)
        while self.read is None and self._remove(rest, error):
            try:
                self.read = model.model_validate(rest)
            except ValidationError as left:
                error = left

    def relocate(self, faults: Iterable[str]) -> list[str]:
        """Faults of :attr:`read` by their places in the whole file, without those that name something removed."""
        return [self._placed(fault) for fault in faults if not any(repr(name) in fault for name in self._removed)]

    def _remove(self, table: dict[str, Any], error: ValidationError) -> bool:
        """Remove what is at the places of the faults, or the tables around them; False where nothing is left."""
        found = {_existing(table, fault["loc"]) for fault in error.errors()} - {()}
        for *parents, last in sorted(found, reverse=True):  # the last entries of a list first
            around: Any = table
            for part in parents:
                around = around[part]
            if isinstance(around, list):
                name = ".".join(map(str, parents))
                del self._kept.setdefault(name, list(range(len(around))))[int(last)]
            value = around.pop(last)
            self._removed |= {*_texts(value), *([str(last)] if isinstance(value, dict) else [])}
        return bool(found)

    def _placed(self, fault: str) -> str:
        for name, kept in self._kept.items():
            parts = re.split(rf"(?<={re.escape(name)}\[)(\d+)(?=\])", fault)
            parts[1::2] = [str(kept[int(part)]) for part in parts[1::2]]
            fault = "".join(parts)
        return fault


def _existing(table: Any, loc: Loc) -> Loc:
    """The longest part of ``loc`` that exists; pydantic adds internal names, and keys that are missing."""
    for depth, part in enumerate(loc):
        keys: Any = table if isinstance(table, dict) else range(len(table)) if isinstance(table, list) else ()
        if part not in keys:
            return loc[:depth]
        table = table[part]
    return loc


def _texts(value: Any) -> Iterator[str]:
    """Every text in a value and its tables."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)
