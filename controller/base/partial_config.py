"""What is left of a configuration file beside its faults, so that the rest can be checked at the same time.

A value that does not fit its key is taken out; where the table around it cannot be read without it, so is that table.
What is said of the rest then leaves out everything that names something in those tables, for it may be at fault only
because they are gone.
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
    """What can still be read of a ``table`` that does not fit ``model``.

    Attributes
    ----------
    read : the rest as ``model``; None where too little is left.
    """

    def __init__(self, table: dict[str, Any], model: type[Model], error: ValidationError) -> None:
        self._table, self._kept, self._gone = copy.deepcopy(table), dict[str, list[int]](), set[str]()
        self.read: Model | None = None
        self._take_values(_locations(error))
        for _ in range(2):
            try:
                self.read = model.model_validate(self._table)
                return
            except ValidationError as left:
                self._take_tables(_locations(left))

    def tell(self, faults: Iterable[str]) -> list[str]:
        """Faults of :attr:`read` by their places in the whole file, without those that may be due to what is gone."""
        return [self._placed(fault) for fault in faults if not any(repr(name) in fault for name in self._gone)]

    def _take_values(self, locations: list[Loc]) -> None:
        for loc in locations:
            at = _at(self._table, loc[:-1])
            if isinstance(at, dict) and loc:
                self._gone |= set(_texts(at.pop(loc[-1], None)))

    def _take_tables(self, locations: list[Loc]) -> None:
        """Take out the entries of lists that still do not fit, or whole keys of the file."""
        entries: dict[Loc, set[int]] = {}
        for loc in locations:
            depth = max((i for i, part in enumerate(loc) if isinstance(part, int)), default=None)
            if depth is None:
                self._take_values([loc[:1]])
            else:
                entries.setdefault(loc[:depth], set()).add(int(loc[depth]))
        for where, numbers in entries.items():
            rows = _at(self._table, where)
            if isinstance(rows, list):
                self._gone |= set(_texts([rows[i] for i in numbers if i < len(rows)]))
                name = ".".join(map(str, where))
                before = self._kept.get(name, list(range(len(rows))))
                self._kept[name] = [n for i, n in enumerate(before) if i not in numbers]
                rows[:] = [row for i, row in enumerate(rows) if i not in numbers]

    def _placed(self, fault: str) -> str:
        for name, kept in self._kept.items():
            parts = re.split(rf"({re.escape(name)}\[\d+\])", fault)
            parts[1::2] = [f"{name}[{kept[int(part[len(name) + 1 : -1])]}]" for part in parts[1::2]]
            fault = "".join(parts)
        return fault


def _locations(error: ValidationError) -> list[Loc]:
    return [fault["loc"] for fault in error.errors()]


def _at(table: Any, loc: Loc) -> Any:
    """What stands at ``loc``; None where nothing does, or where pydantic names a variant instead of a key."""
    for part in loc:
        try:
            table = table[part]
        except (KeyError, IndexError, TypeError):
            return None
    return table


def _texts(value: Any) -> Iterator[str]:
    """Every text in a value and its tables."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)
