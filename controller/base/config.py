"""Reads TOML files into pydantic models and reports every fault at once, each with its path in the file."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, RootModel, ValidationError

from controller.base.errors import ConfigError
from controller.base.files import NEWER
from controller.base.partial_config import PartialConfig
from surface.base import files

Model = TypeVar("Model", bound=BaseModel)

_MAX_FAULTS = 50  # faults listed per file
_guesses_left: ContextVar[list[int] | None] = ContextVar("guesses left", default=None)
_PYDANTIC_NAME = re.compile(r"(constrained|function)-|(tuple|list|dict)\[")  # pydantic's internal names in locations

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite number; neither ``true`` nor ``"1"`` is one."""
Positive = Annotated[Number, Field(gt=0)]
Fraction = Annotated[Number, Field(ge=0, le=1)]
"""A number from 0 to 1."""


class Settings(BaseModel):
    """Base of every configuration table: unknown keys are faults, and values cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def known_keys(cls) -> list[str]:
        """Return the keys that such a table may have, for suggestions."""
        return list(cls.model_fields)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file. Raises ConfigError: it cannot be read or is not TOML."""
    with files.reading(path, ConfigError, hint="correct the line named above"):
        return files.read_toml(path)


def load(path: Path, model: type[Model], cross_check: Callable[[Model], list[str]] | None = None) -> Model:
    """Read the TOML file ``path`` as ``model``.

    cross_check : returns faults that ``model`` cannot find, such as unknown names. If the file does not fit the model,
        it gets the part that does, so that all faults are reported together.

    Raises ConfigError: the file cannot be read, is not TOML, or does not fit; lists every fault with its key.
    """
    return check(read_toml(path), model, path, cross_check)


def check(table: dict[str, Any], model: type[Model], path: Path,
          cross_check: Callable[[Model], list[str]] | None = None) -> Model:  # fmt: skip
    """Turn a table into ``model``; ``path`` only names the source in messages. See :func:`load`."""
    token = _guesses_left.set([2 * _MAX_FAULTS])
    try:
        return _validate(table, model, path, cross_check)
    finally:
        _guesses_left.reset(token)


def may_guess() -> bool:
    """Whether to search for a suggestion for a wrong name; while a file is checked, each call uses up one of a limit.

    A file may have a hundred thousand wrong names, of which only the first faults are listed.
    """
    left = _guesses_left.get()
    if left is None:
        return True
    left[0] -= 1
    return left[0] >= 0


def _validate(table: dict[str, Any], model: type[Model], path: Path,
              cross_check: Callable[[Model], list[str]] | None) -> Model:  # fmt: skip
    try:
        read = model.model_validate(table)
    except ValidationError as error:
        faults = describe_all(error.errors(), model)
        rest = PartialConfig(table, model, error)
        if cross_check is not None and rest.read is not None:
            faults += rest.relocate(cross_check(rest.read))
        raise config_error(path, faults) from error
    if cross_check is not None and (faults := cross_check(read)):
        raise config_error(path, faults)
    return read


def config_error(path: Path, faults: list[str], retry: str = "") -> ConfigError:
    """Return one error that lists the ``faults`` of ``path``; ``retry`` : the command to check it again."""
    listing = "\n".join(f"  {fault}" for fault in faults[:_MAX_FAULTS])
    if len(faults) > _MAX_FAULTS:
        listing += f"\n  and {len(faults) - _MAX_FAULTS} more"
    count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
    newer = any(NEWER in fault for fault in faults)
    hint = "pip install --upgrade omote" if newer else f"correct the file, then: {retry or f'omote check {path}'}"
    return ConfigError(f"{path}: {count}\n{listing}", hint=hint)


def describe_all(faults: Iterable[Any], model: type[BaseModel]) -> list[str]:
    """Describe pydantic faults, see :func:`describe`; the faults of a value of alternative types become one."""
    found: dict[str, list[str]] = {}
    single: list[str] = []
    for fault in faults:
        place = tuple(part for part in fault["loc"] if not _PYDANTIC_NAME.match(str(part)))
        text = describe({**fault, "loc": place}, model)
        where, _, reason = text.partition(": ")
        if place == fault["loc"]:
            single.append(text)
        elif where not in found:
            found[where] = [reason]
            single.append(where)
        elif reason not in found[where]:
            found[where].append(reason)
    return [f"{text}: {', or '.join(found[text])}" if text in found else text for text in single]


def describe(fault: Any, model: type[BaseModel]) -> str:
    """Describe one pydantic fault as ``key.path: reason``, with a suggestion for a misspelt key."""
    where = key_path(fault["loc"])
    if fault["type"] == "extra_forbidden":
        known = _keys_at(model, fault["loc"][:-1]) if may_guess() else []
        close = difflib.get_close_matches(str(fault["loc"][-1]), known, n=1)
        return f"{where}: unknown key" + (f", did you mean {close[0]!r}?" if close else "")
    if fault["type"] == "missing":
        return f"{where}: missing"
    reason = fault["msg"].removeprefix("Value error, ")
    if fault["type"] in ("model_type", "dict_type"):
        reason = "must be a table"
    value = fault.get("input")
    shown = f" (is {shorten(value)})" if isinstance(value, str | int | float | bool) else ""
    return f"{where}: {reason[:1].lower()}{reason[1:]}{shown}"


def shorten(value: object) -> str:
    """Return ``repr(value)``, or its beginning if it is long."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:76]} ..."


def key_path(parts: tuple[str | int, ...]) -> str:
    """Format a location: ``("links", 0, "port")`` becomes ``links[0].port``."""
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or "file"


def _keys_at(model: type[BaseModel], location: tuple[str | int, ...]) -> list[str]:
    """Return the keys that the table at ``location`` may have."""
    current: Any = model
    for part in location:
        field = current.model_fields.get("root" if issubclass(current, RootModel) else part)
        if field is None:  # an index in a list, or a name in a table of tables
            continue
        current = _inner_model(field.annotation)
        if current is None:
            return []
    return current.known_keys() if issubclass(current, Settings) else list(current.model_fields)


def _inner_model(annotation: Any) -> Any:
    """Return the model ``X`` of ``X``, ``list[X]`` or ``X | None``; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        inner = _inner_model(argument)
        if inner is not None:
            return inner
    return None
