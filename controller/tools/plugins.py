"""Every plug-in there is: what omote brings and what other packages add."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from controller.links.kind import LINKS
from controller.takes.reader import TAKES
from controller.tools.export import EXPORTERS
from drivers.base.errors import PluginError
from drivers.base.plugins import Registry
from drivers.core.registry import FAMILIES

SORTS: dict[str, Registry[Any]] = {"bus": FAMILIES, "link": LINKS, "take": TAKES, "export": EXPORTERS}
"""Every sort of plug-in, by what people call one."""


@dataclass(frozen=True)
class Listed:
    """One plug-in.

    Attributes
    ----------
    sort, kind : what it is. title : what people call it; what is wrong with one that cannot be loaded.
    package : name and version of the package it comes from. works : whether it can be loaded. hint : what to type.
    """

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
            why = f"{registry.what} {kind!r} of the package {package} is never used: omote has that kind itself"
            yield Listed(sort, kind, why, package, False, f"pip uninstall {package}, or give it another kind")
