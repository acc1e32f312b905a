"""Lists every plug-in: the kinds of bus, linkage, link, take and export of omote and of other packages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from controller.formats.format import FORMATS
from controller.links.kind import LINKS
from controller.robot.linkages.kind import LINKAGES
from controller.takes.reader import TAKES
from drivers.base.errors import PluginError
from drivers.base.plugins import Registry
from drivers.core.registry import FAMILIES
from surface.export import API, Exporter, exporters


def _check_exporter(exporter: Exporter) -> None:
    """Raise ValueError for a suffix that a built-in exporter has."""
    for one in exporters():
        clash = sorted({*one.suffixes} & {*exporter.suffixes}) if one.kind != exporter.kind else []
        if clash:
            raise ValueError(f"{', '.join(clash)} is written by the built-in kind {one.kind!r}")


EXPORTERS: Registry[Exporter] = Registry(
    Exporter,
    "exporter",
    "omote.exporters",
    API,
    lambda: {one.kind: f"surface.export.{one.kind}" for one in exporters()},
    "EXPORTER",
    check=_check_exporter,
)

SORTS: dict[str, Registry[Any]] = {
    "bus": FAMILIES,
    "linkage": LINKAGES,
    "link": LINKS,
    "format": FORMATS,
    "take": TAKES,
    "export": EXPORTERS,
}
"""The registry of every sort of plug-in."""


def added_exporters() -> list[Exporter]:
    """Exporters of other packages; where two have the same suffix, only the first."""
    own, suffixes, found = {one.kind for one in exporters()}, set[str](), []
    for one in EXPORTERS.all():
        if one.kind not in own and not suffixes & {*one.suffixes}:
            suffixes |= {*one.suffixes}
            found.append(one)
    return found


@dataclass(frozen=True)
class Listed:
    """One plug-in; where it does not work, ``title`` is the reason and ``hint`` what to type."""

    sort: str
    kind: str
    title: str
    package: str
    works: bool = True
    hint: str = ""


def listed() -> Iterator[Listed]:
    """Every plug-in, those that cannot be loaded included."""
    for sort, registry in SORTS.items():
        for kind in registry.kinds():
            package = registry.package_of(kind) or "omote"
            try:
                yield Listed(sort, kind, registry.get(kind).title, package)
            except PluginError as error:
                yield Listed(sort, kind, str(error), package, False, error.hint)
        for kind, package in registry.shadowed():
            why = f"{registry.noun} {kind!r} of the package {package} is never used: omote has that kind itself"
            yield Listed(sort, kind, why, package, False, f"pip uninstall {package}, or give it another kind")
