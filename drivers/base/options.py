"""Options of plug-ins: dataclass fields with help, limits and choices, which the controller checks and reads.

The controller makes keys of a robot file and options of a command from such a dataclass.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from types import UnionType
from typing import Any, get_args, get_type_hints

from drivers.base.errors import DriverError


@dataclass(frozen=True, kw_only=True)
class Option:
    """Help and limits of one option.

    help : one sentence for people.
    at_least, at_most : limits of a number, both allowed; above : lower limit of a number, itself not allowed.
    choices : the only texts allowed. longest : greatest number of characters of a text.
    """

    help: str = ""
    at_least: float | None = None
    at_most: float | None = None
    above: float | None = None
    choices: tuple[str, ...] = ()
    longest: int = 200


REQUIRED: Any = MISSING
"""Default of an option that must be given."""


def option(help: str, default: Any = None, **limits: Any) -> Any:
    """Declare a field of a dataclass of options.

    help : one sentence for people.
    default : None where the plug-in's own default applies; :data:`REQUIRED` where a value must be given.
    limits : further fields of :class:`Option`.
    """
    return field(default=default, metadata={"option": Option(help=help, **limits)})


@dataclass(frozen=True)
class Entry:
    """One option of a dataclass: its name, its type as annotated, its default (or :data:`REQUIRED`), its limits."""

    name: str
    type: Any
    default: Any
    option: Option


def entries(options: type) -> Iterator[Entry]:
    """The options of a dataclass in order."""
    types = get_type_hints(options)
    for each in fields(options):
        default = each.default if each.default_factory is MISSING else each.default_factory()
        yield Entry(each.name, types[each.name], default, each.metadata.get("option", Option()))


def check_options(options: type, reserved: Iterable[str] = ()) -> None:
    """Raise ValueError unless ``options`` is a dataclass whose types are usable and whose names are not `reserved`."""
    if not (isinstance(options, type) and is_dataclass(options)):
        raise ValueError(f"its options must be a dataclass, not {options!r}")
    try:
        found = list(entries(options))
    except NameError as error:
        raise ValueError(f"a type in {options.__name__} cannot be read: {error}") from error
    for entry in found:
        if entry.name in {*reserved} or entry.name.startswith(("_", "model_")):
            raise ValueError(f"{options.__name__}.{entry.name}: the name is taken")
        kinds = set(get_args(entry.type)) - {type(None)} if isinstance(entry.type, UnionType) else {entry.type}
        if not kinds <= {bool, int, float, str, list[str], dict[str, float]} or len(kinds) != 1:
            allowed = "bool, int, float, str, list[str] or dict[str, float], or one of them or None"
            raise ValueError(f"{options.__name__}.{entry.name}: its type must be {allowed}, not {entry.type}")


MAX_DIGITS = 9
"""Only so many digits of a number are read; a number with more is too large anyway."""


def parse_ids(text: str, most: int = 252) -> list[int]:
    """Parse ids: ``1-3,7`` gives [1, 2, 3, 7]. Raises DriverError for other text, repeated ids, ids above ``most``."""
    hint = "for example --ids 1-24, or --ids 1,3,7-9"
    outside = DriverError(f"--ids {text}: ids go from 0 to {most}, each once", hint=hint)
    ids: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", part.strip())
        if match is None:
            raise DriverError(f"--ids {text}: {part.strip()!r} is no id", hint=hint)
        first, last = (int(number.lstrip("0")[:MAX_DIGITS] or 0) for number in (match[1], match[2] or match[1]))
        if first > last:
            raise DriverError(f"--ids {text}: {part.strip()!r} runs backwards", hint=hint)
        if last > most:
            raise outside
        ids += range(first, last + 1)
    if not ids or len(set(ids)) != len(ids):
        raise outside
    return ids
