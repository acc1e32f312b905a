"""Makes pydantic models of dataclasses of options (:mod:`drivers.base.options`), and of tables that name a plug-in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, Field, ValidationError, ValidatorFunctionWrapHandler, WrapValidator, create_model

from controller.base.errors import ConfigError
from drivers.base.errors import PluginError
from drivers.base.options import REQUIRED, Entry, Option, entries
from drivers.base.plugins import Registry

Model = TypeVar("Model", bound=BaseModel)


def fields_of(options: type) -> dict[str, tuple[Any, Any]]:
    """For :func:`pydantic.create_model`: the annotated type and the default of each option of a dataclass."""
    return {
        entry.name: (_annotated(entry), ... if entry.default is REQUIRED else entry.default)
        for entry in entries(options)
    }


def to_options(table: BaseModel, options: type) -> Any:
    """An instance of a dataclass of options, from the keys given in a table made by :func:`fields_of`."""
    names = table.model_fields_set & {field.name for field in fields(options)}  # reading their types would be slow
    return options(**{name: getattr(table, name) for name in names})


def from_command_line(options: type, given: dict[str, Any]) -> Any:
    """An instance of a dataclass of options from what a command line gave.

    Raises ConfigError: a value is beyond its limits; names every such option.
    """
    make: Any = create_model
    try:
        table = make(options.__name__, **fields_of(options)).model_validate(given)
    except ValidationError as error:
        faults = [f"--{str(fault['loc'][0]).replace('_', '-')}: {fault['msg']}" for fault in error.errors()]
        raise ConfigError("; ".join(faults), hint="add --help to see the options") from error
    return options(**{entry.name: getattr(table, entry.name) for entry in entries(options)})


def check_kind(registry: Registry[Any], kind: str) -> str:
    """A kind that is installed. Raises ValueError: it is not installed, or cannot be loaded; lists those that are."""
    try:
        registry.get(kind)
    except PluginError as error:
        raise ValueError(f"{error} ({error.hint})") from error
    return kind


def parse_with(read: Callable[[dict[str, Any]], Model]) -> WrapValidator:
    """For an entry of a list in a file: a table is read by ``read``, which knows the model of its kind."""

    def check(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        return read(value) if isinstance(value, dict) else handler(value)

    return WrapValidator(check)


def bare_type(annotation: Any) -> Any:
    """``X`` of ``X | None``, and anything else as it is."""
    if get_origin(annotation) in (Union, UnionType):
        kinds = [kind for kind in get_args(annotation) if kind is not type(None)]
        return kinds[0] if len(kinds) == 1 else annotation
    return annotation


def _annotated(entry: Entry) -> Any:
    kind = bare_type(entry.type)
    checked = _checked(kind, entry.option)
    return checked if kind is entry.type else checked | None


def _checked(kind: Any, limits: Option) -> Any:
    if limits.choices:
        return Literal[limits.choices]
    if kind is str:
        return Annotated[str, Field(max_length=limits.longest)]
    if kind in (int, float):
        ends: dict[str, Any] = {"ge": limits.at_least, "le": limits.at_most, "gt": limits.above}
        if kind is float:
            ends["allow_inf_nan"] = False
        return Annotated[kind, Field(**ends)]
    return kind
