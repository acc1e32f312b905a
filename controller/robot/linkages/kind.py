"""Defines what a kind of linkage is, and registers all kinds.

A kind is a module ``KIND_linkage`` in ``controller/robot/linkages/kinds`` that holds ``LINKAGE``, or another package
with an entry point in the group ``omote.linkages`` that names a :class:`LinkageKind`; see docs/extending.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Protocol

from pydantic import BeforeValidator, Field, field_validator

from controller.base.config import Settings
from controller.base.parameters import Floats
from controller.base.schema import check_kind, parse_with
from controller.robot.formulas import parse_formula
from controller.robot.terms import Term
from drivers.base.errors import PluginError
from drivers.base.plugins import Registry, modules_in

API = 1
"""Version of the interface that a kind of linkage implements: this module."""
_SUFFIX = "_linkage"


def _readable(text: Any) -> Any:
    if isinstance(text, str):
        parse_formula(text)
    return text


Input = Annotated[str | dict[str, Term], BeforeValidator(_readable)]
"""What an input follows: a formula, or terms as those of a channel's mix that are added."""


class LinkageSettings(Settings):
    """A linkage of a robot; the settings of its kind add its geometry.

    channels : its servos, in the order of the geometry. inputs : what each of its inputs follows, in degrees or mm.
    """

    name: str
    kind: str
    channels: Annotated[list[str], Field(min_length=1, max_length=16)]
    inputs: Annotated[dict[str, Input], Field(min_length=1, max_length=8)]

    @classmethod
    def known_keys(cls) -> list[str]:
        """Keys that a table of a linkage may have, including those of all kinds."""
        own = {key for kind in LINKAGES.all() for key in kind.settings.model_fields}
        return [*super().known_keys(), *sorted(own)]

    @field_validator("kind")
    @classmethod
    def _is_known(cls, value: str) -> str:
        return check_kind(LINKAGES, value)


class Linkage(Protocol):
    """Converts inputs to angles of servos."""

    def angles(self, inputs: Floats) -> tuple[Floats, bool]:
        """(n,) degrees of the servos for inputs (k,), and whether the inputs are unreachable.

        Then the angles belong to reachable inputs on the way to them. Angles are always finite.
        """


@dataclass(frozen=True, kw_only=True)
class LinkageKind:
    """One kind of linkage.

    api : version of the registry it is made for. kind : its name in robot files. title : its name for people.
    settings : class of its settings in a robot file. make : creates the linkage from them; raises ConfigError or
        ValueError. install : argument of ``pip install`` for a package that it needs.
    """

    api: int
    kind: str
    title: str
    settings: type[LinkageSettings]
    make: Callable[[Any], Linkage]
    install: str = ""


def _own() -> dict[str, str]:
    """Modules of the built-in kinds."""
    found = modules_in("controller.robot.linkages.kinds").items()
    return {stem.removesuffix(_SUFFIX): module for stem, module in found if stem.endswith(_SUFFIX)}


LINKAGES: Registry[LinkageKind] = Registry(LinkageKind, "kind of linkage", "omote.linkages", API, _own, "LINKAGE")


class _Unknown(LinkageSettings, extra="ignore"):
    """A linkage of an unknown kind, whose other keys cannot be checked."""


def read_linkage(table: dict[str, Any]) -> LinkageSettings:
    """Read a linkage from its table in a robot file. Raises pydantic.ValidationError, with all faults by key."""
    try:
        settings = LINKAGES.get(str(table.get("kind"))).settings
    except PluginError:
        settings = _Unknown  # its error names the kind
    return settings.model_validate(table)


AnyLinkage = Annotated[LinkageSettings, parse_with(read_linkage)]
"""An entry of ``[[linkages]]``, read with the settings of its kind."""
