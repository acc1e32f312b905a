"""Reads the links of a stage file from their tables, and opens them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any

from pydantic import create_model, field_validator, model_validator

from controller.base.config import Settings
from controller.base.schema import check_kind, fields_of, parse_with, to_options
from controller.links.kind import LINKS, Link, LinkContext, LinkKind
from drivers.base.errors import PluginError


class LinkSettings(Settings):
    """A link of a stage; :func:`read_link` adds the options of its kind."""

    kind: str = "line"

    @classmethod
    def known_keys(cls) -> list[str]:
        """Return the keys of such a table, including those of all kinds of links."""
        own = {key for kind in LINKS.all() for key in fields_of(kind.settings)}
        return [*super().known_keys(), *sorted(own)]

    @property
    def own(self) -> Any:
        """The options of its kind: an instance of the kind's settings."""
        return to_options(self, LINKS.get(self.kind).settings)

    @property
    def simulated(self) -> str | None:
        """The script that a simulated far end plays; None if there is none."""
        return getattr(self.own, "simulated", None)

    @property
    def takes_input(self) -> bool:
        """Whether it reads standard input."""
        return bool(getattr(self.own, "takes_input", False))

    def __str__(self) -> str:
        address = getattr(self.own, "address", "")
        return f"{self.kind} on {address}" if address else self.kind

    @field_validator("kind")
    @classmethod
    def _is_known(cls, value: str) -> str:
        return check_kind(LINKS, value)

    @model_validator(mode="after")
    def _fits(self) -> LinkSettings:
        check = getattr(self.own, "check", None)
        if check is not None:
            with LINKS.naming_package(self.kind):
                check()
        return self


def read_link(table: dict[str, Any]) -> LinkSettings:
    """Return a link from its table in a stage file, with the options of its kind.

    Raises pydantic.ValidationError: lists every fault with its key.
    """
    try:
        kind = LINKS.get(str(table.get("kind", "line")))
    except PluginError:
        return _Unknown.model_validate(table)  # whose error names the kind
    return _model_of(kind).model_validate(table)


def open_links(choices: Sequence[LinkSettings], context: LinkContext) -> list[Link]:
    """Open every link of a stage; what closes them is added to ``context.closers``.

    Raises LinkError, PortError: a link cannot be opened. PluginError: a package that it needs is not installed.
    """
    found = []
    for choice in choices:
        kind = LINKS.get(choice.kind)
        start = LINKS.load(kind, kind.open)
        with LINKS.naming_package(kind.kind):
            link: Link = start(choice.own, context)
        found.append(link)
    return found


class _Unknown(LinkSettings, extra="ignore"):
    """A link of an unknown kind, whose other keys cannot be checked."""


@cache
def _model_of(kind: LinkKind) -> type[LinkSettings]:
    make: Any = create_model
    made: type[LinkSettings] = make(f"{kind.kind} link", __base__=LinkSettings, **fields_of(kind.settings))
    return made


LinkTable = Annotated[LinkSettings, parse_with(read_link)]
"""An entry of ``[[links]]``, read with the options of its kind."""
