"""Registries of plug-ins (bus families, links, readers, exporters): built-in ones by folder, others by entry point.

A plug-in is a small frozen dataclass at module level that names, as ``"module:name"``, what does the work. A definition
imports next to nothing, so that all of them can be listed at once; what it names is imported when it is used. The entry
point of a plug-in in another package has the plug-in's kind as its name.
"""

from __future__ import annotations

import difflib
import logging
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field
from importlib import import_module
from importlib.util import find_spec
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, get_origin, get_type_hints

from drivers.base.errors import PluginError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

log = logging.getLogger(__name__)


class Plugin(Protocol):
    """Fields of every definition.

    api : version of the registry it is made for. kind : its name in files and commands.
    install : argument of ``pip install`` where a package that it needs is missing; empty: the package's own name.
    """

    @property
    def api(self) -> int: ...
    @property
    def kind(self) -> str: ...
    @property
    def install(self) -> str: ...


P = TypeVar("P", bound=Plugin)


@dataclass(eq=False)
class Registry(Generic[P]):
    """All plug-ins of one sort.

    A plug-in that cannot be loaded affects no other: :meth:`all` leaves it out and logs it once, and :meth:`get` raises
    what went wrong. Another package cannot replace a built-in kind.

    sort : the dataclass of their definitions.
    what : name of one in messages, as ``"bus kind"``.
    group : entry points of other packages, as ``"omote.drivers"``.
    version : version of the interface; a plug-in made for another one is refused.
    builtin : gives the built-in kinds and the module of each, or ``"module:name"`` of its definition.
    attribute : name of a definition in its module, where the kind does not name another.
    reserved : kinds that no package may add.
    check : raises an error for a definition that this sort cannot use.
    """

    sort: type[P]
    what: str
    group: str
    version: int
    builtin: Callable[[], Mapping[str, str]]
    attribute: str
    _: KW_ONLY
    reserved: Collection[str] = ()
    check: Callable[[P], None] = lambda plugin: None
    _loaded: dict[str, P] = field(default_factory=dict, init=False)
    _logged: set[str] = field(default_factory=set, init=False)

    def kinds(self) -> list[str]:
        """Every kind that is installed, whether or not it can be loaded, in order."""
        return sorted({*self.builtin(), *self._foreign()} - set(self.reserved))

    def all(self) -> list[P]:
        """Every plug-in that can be loaded: the built-in ones in the order of their kinds, then the others."""
        found = []
        builtin = self.builtin()
        for kind in sorted(self.kinds(), key=lambda kind: (kind not in builtin, kind)):
            try:
                found.append(self.get(kind))
            except PluginError as error:
                self._log_once(str(error))
        return found

    def get(self, kind: str) -> P:
        """The plug-in of a kind; raises PluginError where it is not installed or cannot be loaded."""
        if kind in self._loaded:
            return self._loaded[kind]
        module = self.builtin().get(kind)
        if module is not None:
            name, hint = f"{self.what} {kind!r} in {module}", f"fix {module}"
        else:
            entry, package = self._entry_point(kind)
            name = f"{self.what} {kind!r} of the package {package}"
            hint = f"pip install --upgrade {package}, or ask its maker"
        try:
            plugin: P = self._of_module(module) if module is not None else entry.load()
        except (Exception, SystemExit) as error:  # whatever a module of another package raises
            raise PluginError(f"{name} cannot be loaded: {_describe(error)}", hint=hint) from error
        self._check(plugin, kind, name, hint)
        self._loaded[kind] = plugin
        return plugin

    def load(self, plugin: P, reference: str) -> Any:
        """Import what a plug-in names as ``"module:name"``; raises PluginError where that fails."""
        module, _, name = reference.partition(":")
        mine = f"{self.what} {plugin.kind!r}"
        try:
            with self.importing(plugin):
                found = import_module(module)
        except PluginError:
            raise
        except (Exception, SystemExit) as error:  # whatever a module of another package raises
            raise PluginError(f"{mine}: {module} cannot be loaded: {_describe(error)}", hint=_UPDATE) from error
        try:
            return attrgetter(name)(found)
        except AttributeError as error:
            raise PluginError(f"{mine} names {reference}, and there is nothing of that name", hint=_UPDATE) from error

    @contextmanager
    def importing(self, plugin: P) -> Iterator[None]:
        """Context of imports for a plug-in; PluginError names the package to install where a module is missing."""
        try:
            yield
        except ModuleNotFoundError as error:
            raise self._missing(f"{self.what} {plugin.kind!r}", plugin, error.name or "a module") from error

    @contextmanager
    def blaming(self, kind: str) -> Iterator[None]:
        """Context of a call to a plug-in that names the plug-in's package in unexpected errors.

        Errors with a ``hint``, and ValueError, which a check may raise, pass unchanged.
        """
        try:
            yield
        except Exception as error:
            package = "" if isinstance(error, ValueError) or hasattr(error, "hint") else self.package_of(kind)
            if not package:
                raise
            raise PluginError(
                f"{self.what} {kind!r} of the package {package} failed: {_describe(error)}",
                hint="update that package, or report it to its maker; OMOTE_DEBUG=1 prints the traceback",
            ) from error

    def package_of(self, kind: str) -> str:
        """Names and versions of the packages that have a kind; empty for a built-in one."""
        entries = [] if kind in self.builtin() else self._foreign().get(kind, [])
        return ", ".join(f"{entry.dist.name} {entry.dist.version}" for entry in entries if entry.dist is not None)

    def shadowed(self) -> Iterator[tuple[str, str]]:
        """Kinds of other packages that are ignored because omote has them itself, with the name of the package."""
        taken = {*self.builtin(), *self.reserved}
        for kind, entries in sorted(self._foreign().items()):
            if kind in taken:
                yield from ((kind, _package(entry)) for entry in entries)

    def forget(self) -> None:
        """Clear what was loaded and logged, as after another package was installed."""
        self._loaded.clear()
        self._logged.clear()

    def _of_module(self, reference: str) -> P:
        module, _, name = reference.partition(":")
        found: P = getattr(import_module(module), name or self.attribute)
        return found

    def _missing(self, mine: str, plugin: P, name: str) -> PluginError:
        """The error for a module that is not found: its package is not installed, or lacks the module."""
        package = name.partition(".")[0]
        if package != name and find_spec(package) is not None:
            return PluginError(f"{mine}: there is no module {name}", hint=_UPDATE)
        needed = plugin.install or package  # a shell would read brackets as a pattern
        return PluginError(
            f"{mine} needs the package {package!r}, which is not installed",
            hint=f'pip install "{needed}"' if "[" in needed else f"pip install {needed}",
        )

    def _foreign(self) -> dict[str, list[EntryPoint]]:
        """Entry points of this group by name; packages whose lists cannot be read are logged once and left out."""
        from importlib.metadata import distributions  # start-up: built-in kinds are found without it

        found: dict[str, dict[tuple[str, str], EntryPoint]] = {}
        for package in distributions():
            try:
                entries = [entry for entry in package.entry_points if entry.group == self.group]
                for entry in entries:
                    found.setdefault(entry.name, {}).setdefault((package.name, entry.value), entry)
            except Exception as error:  # noqa: BLE001  a damaged list of one package affects no other
                self._log_once(f"the entry points of {package} cannot be read: {type(error).__name__}: {error}")
        return {name: [*entries.values()] for name, entries in found.items()}

    def _entry_point(self, kind: str) -> tuple[EntryPoint, str]:
        """The only entry point of a kind, and the name of its package."""
        entries = self._foreign().get(kind, []) if kind not in self.reserved else []
        packages = sorted({_package(entry) for entry in entries})
        if not entries:
            known = self.kinds()
            close = difflib.get_close_matches(kind, known, n=1)
            guess = f", did you mean {close[0]!r}?" if close else ""
            raise PluginError(f"unknown {self.what} {kind!r}{guess}", hint=f"use one of: {', '.join(known)}")
        if len(entries) > 1:
            raise PluginError(
                f"{self.what} {kind!r} is in more than one package: {', '.join(packages)}",
                hint=f"pip uninstall {packages[-1]}",
            )
        return entries[0], packages[0]

    def _check(self, plugin: Any, kind: str, mine: str, hint: str) -> None:
        made_for = getattr(plugin, "api", None)
        if made_for is not None and made_for != self.version:
            newer = isinstance(made_for, int) and made_for > self.version
            raise PluginError(
                f"{mine} is made for version {made_for} of {self.group}; this omote has version {self.version}",
                hint="pip install --upgrade omote" if newer else hint,
            )
        if not isinstance(plugin, self.sort):
            raise PluginError(f"{mine} must be a {self.sort.__name__}, not {plugin!r}", hint=hint)
        if plugin.kind != kind:
            raise PluginError(f"{mine} says that its kind is {plugin.kind!r}; both must be the same", hint=hint)
        try:
            _check_types(plugin)
            self.check(plugin)
        except Exception as error:
            raise PluginError(f"{mine} cannot be used: {error}", hint=hint) from error

    def _log_once(self, message: str) -> None:
        if message not in self._logged:
            self._logged.add(message)
            log.warning("%s", message)


_UPDATE = "update the package that it comes from, or fix it"


def _check_types(plugin: Any) -> None:
    """Raises ValueError for a field of a definition that has the wrong type; only plain types are checked."""
    for name, kind in get_type_hints(type(plugin)).items():
        value = getattr(plugin, name)
        if get_origin(kind) is tuple:
            if not isinstance(value, tuple) or not all(isinstance(each, str) for each in value):
                raise ValueError(f"{name} must be a tuple of texts, not {value!r}")
        elif kind in (str, int, bool, type) and not isinstance(value, kind):
            raise ValueError(f"{name} must be {kind.__name__}, not {value!r}")


def _describe(error: BaseException) -> str:
    """Type and message of an error, with file and line of a syntax error."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__} in {error.filename}, line {error.lineno}: {error.msg}"
    return f"{type(error).__name__}: {error}"


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else entry.value


def folders_with(package: str, module: str) -> dict[str, str]:
    """Sub-packages of a package that hold a module of a name: name of each, and the module's full name."""
    paths = [path for folder in _folders(package) for path in folder.glob(f"*/{module}.py")]
    return {path.parent.name: f"{package}.{path.parent.name}.{module}" for path in paths}


def modules_in(package: str) -> dict[str, str]:
    """Modules of a package without those that begin with an underscore: name and full name of each."""
    names = [path.stem for folder in _folders(package) for path in folder.glob("[!_]*.py")]
    return {name: f"{package}.{name}" for name in names}


def _folders(package: str) -> list[Path]:
    spec = find_spec(package)
    return [Path(place) for place in (spec.submodule_search_locations or ())] if spec else []
