"""Defines what a kind of link is, and registers all kinds.

A link is a folder of ``controller/links`` with a module ``kind`` that holds ``LINK``, or a format of
``controller/formats``, or another package with an entry point in the group ``omote.links`` that names a
:class:`LinkKind`; see docs/extending.md.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from controller.formats.format import FORMATS
from controller.layers.commands import CommandSink
from drivers.base.options import check_options
from drivers.base.plugins import Registry, folders_with

API = 1
"""Version of what a link must keep: this module and :class:`controller.layers.commands.CommandSink`."""


@dataclass(frozen=True)
class LinkContext:
    """Where the commands of a link go, and what it may use.

    sink : where accepted commands go, with the time they arrived.
    closers : gets what closes the link and all that was started with it; called in reverse order.
    vocabularies : files of further expressions that the stage names. beside : the stage's file. head : the folder of
        the head that is moved.
    """

    sink: CommandSink
    closers: ExitStack
    vocabularies: tuple[Path, ...] = ()
    beside: Path | None = None
    head: Path | None = None


class Link(Protocol):
    """A link that is open; it takes commands in its own thread until it is closed."""

    def report(self) -> dict[str, object]:
        """Counts: ``port`` (the name of its far end), ``accepted``, ``refused`` (counts by reason)."""


@dataclass(frozen=True, kw_only=True)
class LinkKind:
    """A kind of link.

    api : version of the registry it is made for; see :data:`API`.
    kind : its name in stages. title : its name for people.
    settings : dataclass of its options in a stage (:mod:`drivers.base.options`). It may have a method ``check()``
        that raises ValueError, a property ``address`` (where it listens, for people), and a property ``simulated``
        (the script that a simulated far end plays, or None).
    open : ``"module:name"`` of a function that takes such settings and a :class:`LinkContext`, and returns a
        :class:`Link`; it raises LinkError or PortError.
    install : what ``pip install`` takes where a package is missing.
    """

    api: int
    kind: str
    title: str
    settings: type
    open: str
    install: str = ""


def _own() -> dict[str, str]:
    """Links with a folder of their own, and one for each format."""
    formats = {kind: f"controller.links.net.kinds:LINK_{kind}" for kind in FORMATS.builtin()}
    return formats | folders_with("controller.links", "kind")


LINKS: Registry[LinkKind] = Registry(
    LinkKind,
    "link kind",
    "omote.links",
    API,
    _own,
    "LINK",
    check=lambda link: check_options(link.settings, {"kind"}),
)
