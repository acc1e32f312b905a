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
"""Version of the interface of links: this module and :class:`controller.layers.commands.CommandSink`."""


@dataclass(frozen=True)
class LinkContext:
    """What a link needs of the run that it belongs to.

    sink : receives accepted commands, with the time they arrived.
    closers : the link adds to it what closes it and everything it started; called in reverse order.
    vocabularies : files of further expressions that the stage names. beside : the stage file, to whose folder paths are
        relative. head : the folder of the head that is moved.
    """

    sink: CommandSink
    closers: ExitStack
    vocabularies: tuple[Path, ...] = ()
    beside: Path | None = None
    head: Path | None = None


class Link(Protocol):
    """An open link; it receives commands in its own thread until it is closed."""

    def report(self) -> dict[str, object]:
        """Return ``port`` (the name of its far end), ``accepted`` (a count) and ``refused`` (counts by reason)."""


@dataclass(frozen=True, kw_only=True)
class LinkKind:
    """A kind of link.

    api : version of the registry that the kind is made for; see :data:`API`.
    kind : its name in stage files. title : its name for people.
    settings : dataclass of its options in a stage file (:mod:`drivers.base.options`). It may have a method ``check()``
        that raises ValueError, a property ``address`` (where it listens, for people), and a property ``simulated``
        (the script that a simulated far end plays, or None).
    open : ``"module:name"`` of a function that takes such settings and a :class:`LinkContext`, and returns a
        :class:`Link`; it raises LinkError or PortError.
    install : argument of ``pip install`` if a package is missing.
    """

    api: int
    kind: str
    title: str
    settings: type
    open: str
    install: str = ""


def _built_in() -> dict[str, str]:
    """Return the modules of the built-in kinds: those with their own folder, and one for each format."""
    formats = {kind: f"controller.links.net.kinds:LINK_{kind}" for kind in FORMATS.builtin()}
    return formats | folders_with("controller.links", "kind")


LINKS: Registry[LinkKind] = Registry(
    LinkKind,
    "link kind",
    "omote.links",
    API,
    _built_in,
    "LINK",
    check=lambda link: check_options(link.settings, {"kind"}),
)
