"""Plug-ins: families, links and the like, which are found and not listed.

A plug-in is a small frozen dataclass at module level that says what it is and names, as ``"module:name"``, what does
the work. The built-in ones are found by their folder, those of other packages by an entry point whose name is their
kind. A definition imports next to nothing, so that all of them can be listed at once; what it names is imported when
somebody asks for it.
"""

from __future__ import annotations

import difflib
import logging
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from drivers.base.errors import PluginError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

log = logging.getLogger(__name__)


class Plugin(Protocol):
    """What every definition says of itself.

    Attributes
    ----------
    api : version of the registry it is made for. kind : what files and commands call it.
    install : what ``pip install`` takes where a package that it needs is missing; empty: the package's own name.
    """

    @property
    def api(self) -> int: ...
    @property
    def kind(self) -> str: ...
    @property
    def install(self) -> str: ...


P = TypeVar("P", bound=Plugin)


class Registry(Generic[P]):
    """All plug-ins of one sort.

    Parameters
    ----------
    sort : the dataclass of their definitions.
    what : what messages call one, as ``"bus kind"``.
    group : entry points of other packages, as ``"omote.drivers"``; each is named as the kind it adds.
    version : of what plug-ins of this sort must keep; one made for another version is refused.
    builtin : gives the built-in kinds and the module that holds each.
    attribute : what a definition is called in its module.
    also : kinds that messages name besides.
    error : what is raised.

    Notes
    -----
    A plug-in that cannot be loaded breaks nothing but itself: it is left out of :meth:`all`, told once, and asking
    for its kind raises what went wrong. A built-in kind cannot be replaced by another package.
    """

    def __init__(
        self,
        sort: type[P],
        what: str,
        group: str,
        version: int,
        builtin: Callable[[], Mapping[str, str]],
        attribute: str,
        *,
        also: Iterable[str] = (),
        error: type[PluginError] = PluginError,
    ) -> None:
        self._sort, self.what, self.group, self.version = sort, what, group, version
        self._builtin, self._attribute, self._also, self._error = builtin, attribute, tuple(also), error
        self._loaded: dict[str, P] = {}
        self._failed: dict[str, PluginError] = {}

    def kinds(self) -> list[str]:
        """Every kind that is installed, whether or not it can be loaded, in order."""
        return sorted({*self._builtin(), *self._foreign()})

    def all(self) -> list[P]:
        """Every plug-in that can be loaded, in the order of their kinds."""
        found = []
        for kind in self.kinds():
            try:
                found.append(self.get(kind))
            except PluginError as error:
                if kind not in self._failed:
                    log.warning("%s", error)
                self._failed[kind] = error
        return found

    def get(self, kind: str) -> P:
        """The plug-in of a kind.

        Raises
        ------
        PluginError : nothing of that kind is installed, or it cannot be loaded.
        """
        if kind not in self._loaded:
            module = self._builtin().get(kind)
            self._loaded[kind] = self._foreign_one(kind) if module is None else self._own(module)
        return self._loaded[kind]

    def load(self, plugin: P, reference: str) -> Any:
        """What a plug-in names as ``"module:name"``.

        Raises
        ------
        PluginError : a package that it needs is not installed, or there is nothing of that name.
        """
        module, _, name = reference.partition(":")
        try:
            return reduce(getattr, name.split("."), import_module(module))
        except ModuleNotFoundError as error:
            missing = error.name or module
            raise self._error(
                f"{self.what} {plugin.kind!r} needs the package {missing.partition('.')[0]!r}, which is not installed",
                hint=f"pip install {_quoted(plugin.install) or missing.partition('.')[0]}",
            ) from error
        except AttributeError as error:
            raise self._error(
                f"{self.what} {plugin.kind!r} names {reference}, and there is nothing of that name",
                hint="update the package that it comes from",
            ) from error

    def package_of(self, kind: str) -> str:
        """Name and version of the package a kind comes from; empty for a built-in one."""
        entry = None if kind in self._builtin() else self._foreign().get(kind)
        return f"{entry.dist.name} {entry.dist.version}" if entry is not None and entry.dist is not None else ""

    def forget(self) -> None:
        """Look for everything anew, as after another package was installed."""
        self._loaded.clear()
        self._failed.clear()

    def _own(self, module: str) -> P:
        plugin: P = getattr(import_module(module), self._attribute)
        return plugin

    def _foreign(self) -> dict[str, EntryPoint]:
        from importlib.metadata import entry_points  # start-up: built-in kinds are found without it

        return {entry.name: entry for entry in entry_points(group=self.group)}

    def _foreign_one(self, kind: str) -> P:
        entry = self._foreign().get(kind)
        if entry is None:
            raise self._unknown(kind)
        package = entry.dist.name if entry.dist is not None else entry.module
        try:
            plugin: P = entry.load()
        except (Exception, SystemExit) as error:  # whatever a foreign module does, it must break nothing but itself
            raise self._error(
                f"{self.what} {kind!r} of the package {package} cannot be loaded: {type(error).__name__}: {error}",
                hint=f"pip install --upgrade {package}",
            ) from error
        self._check(plugin, kind, package)
        return plugin

    def _check(self, plugin: Any, kind: str, package: str) -> None:
        hint = f"pip install --upgrade {package}, or ask whoever made it"
        made_for = getattr(plugin, "api", None)
        if made_for != self.version:
            raise self._error(
                f"{self.what} {kind!r} of the package {package} is made for version {made_for} of {self.group}; "
                f"this omote has version {self.version}",
                hint=hint,
            )
        if not isinstance(plugin, self._sort) or plugin.kind != kind:
            raise self._error(
                f"{self.what} {kind!r} of the package {package}: its entry point must name a {self._sort.__name__} "
                f"of that kind, not {plugin!r}",
                hint=hint,
            )

    def _unknown(self, kind: str) -> PluginError:
        known = sorted({*self.kinds(), *self._also})
        close = difflib.get_close_matches(kind, known, n=1)
        guess = f", did you mean {close[0]!r}?" if close else ""
        return self._error(f"unknown {self.what} {kind!r}{guess}", hint=f"use one of: {', '.join(known)}")


def _quoted(requirement: str) -> str:
    """What a shell would read brackets in as a pattern is put in quotes."""
    return f'"{requirement}"' if "[" in requirement else requirement


def folders_with(package: str, module: str) -> dict[str, str]:
    """Sub-packages that hold a module of a name: the name of each, and the module in full."""
    found = {}
    for folder in _folders(package):
        for path in folder.glob(f"*/{module}.py"):
            found[path.parent.name] = f"{package}.{path.parent.name}.{module}"
    return found


def modules_in(package: str) -> dict[str, str]:
    """Modules of a package but those that begin with an underscore: the name of each, and the name in full."""
    names = [path.stem for folder in _folders(package) for path in folder.glob("*.py")]
    return {name: f"{package}.{name}" for name in names if not name.startswith("_")}


def _folders(package: str) -> list[Path]:
    spec = find_spec(package)
    return [Path(place) for place in (spec.submodule_search_locations or ())] if spec else []
