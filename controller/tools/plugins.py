"""Lists every plug-in: the kinds of bus, linkage, link, format, take and export of omote and of other packages."""

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

REGISTRIES: dict[str, Registry[Any]] = {
    "bus": FAMILIES,
    "linkage": LINKAGES,
    "link": LINKS,
    "format": FORMATS,
    "take": TAKES,
    "export": EXPORTERS,
}
"""Every registry of plug-ins, by its name in lists."""


def added_exporters() -> list[Exporter]:
    """Return the exporters of other packages; of two that share a suffix, only the first."""
    builtin, suffixes, found = {one.kind for one in exporters()}, set[str](), []
    for one in EXPORTERS.all():
        if one.kind not in builtin and not suffixes & {*one.suffixes}:
            suffixes |= {*one.suffixes}
            found.append(one)
    return found


@dataclass(frozen=True)
class ListedPlugin:
    """One plug-in. If it cannot be used, ``fault`` says why and ``hint`` what to type next; else both are empty."""

    registry: str
    kind: str
    title: str
    package: str
    fault: str = ""
    hint: str = ""


def list_plugins() -> Iterator[ListedPlugin]:
    """Yield every plug-in, also those that cannot be used."""
    for name, registry in REGISTRIES.items():
        for kind in registry.kinds():
            package = registry.package_of(kind) or "omote"
            try:
                yield ListedPlugin(name, kind, registry.get(kind).title, package)
            except PluginError as error:
                yield ListedPlugin(name, kind, "", package, str(error), error.hint)
        for kind, package in registry.shadowed():
            fault = f"{registry.noun} {kind!r} of the package {package} is never used: omote has that kind itself"
            yield ListedPlugin(name, kind, "", package, fault, f"pip uninstall {package}, or give it another kind")
