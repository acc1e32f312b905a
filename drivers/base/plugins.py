"""Registries of plug-ins, such as bus families, links or exporters; there is one registry for each category.

A plug-in is described by its definition: a small frozen dataclass at module level that names, as ``"module:name"``, the
code that does the work. A definition imports next to nothing, so that all of them can be listed quickly; the code that
it names is imported when it is used. The kind of a plug-in is its name in files and commands. Built-in plug-ins are
found by folder, those of other packages by an entry point that has the plug-in's kind as its name.
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
    """Fields that every definition has.

    api : version of the registry's interface that it is made for. kind : its name in files and commands.
    install : argument of ``pip install`` for a missing package that it needs; empty: the name of that package.
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
    """All plug-ins of one category.

    A plug-in that cannot be loaded affects no other: :meth:`all` leaves it out and logs it once, and :meth:`get` raises
    the reason. Another package cannot replace a built-in kind.

    definition : the dataclass of the definitions.
    noun : what a plug-in is called in messages, as ``"bus kind"``.
    group : group of the entry points in other packages, as ``"omote.drivers"``.
    version : version of the interface; a plug-in that states another one is refused.
    builtin : returns, for each built-in kind, the module of its definition, or ``"module:name"`` of it.
    attribute : name of the definition in such a module, where ``builtin`` gives no name.
    reserved : kinds that no package may add.
    check : raises an error for a definition that cannot be used in this category.
    """

    definition: type[P]
    noun: str
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
        """Every kind that is installed, whether or not it can be loaded, sorted by name."""
        return sorted({*self.builtin(), *self._entry_points()} - set(self.reserved))

    def all(self) -> list[P]:
        """Every plug-in that can be loaded: the built-in ones sorted by kind, then the others sorted by kind."""
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
            name, hint = f"{self.noun} {kind!r} in {module}", f"fix {module}"
        else:
            entry, package = self._entry_point(kind)
            name = f"{self.noun} {kind!r} of the package {package}"
            hint = f"pip install --upgrade {package}, or ask its maker"
        try:
            plugin: P = self._load_builtin(module) if module is not None else entry.load()
        except (Exception, SystemExit) as error:  # whatever a module of another package raises
            raise PluginError(f"{name} cannot be loaded: {_describe(error)}", hint=hint) from error
        self._check(plugin, kind, name, hint)
        self._loaded[kind] = plugin
        return plugin

    def load(self, plugin: P, reference: str) -> Any:
        """Import and return what a plug-in names as ``"module:name"``; raises PluginError where that fails."""
        module, _, name = reference.partition(":")
        subject = f"{self.noun} {plugin.kind!r}"
        try:
            with self.importing(plugin):
                found = import_module(module)
        except PluginError:
            raise
        except (Exception, SystemExit) as error:  # whatever a module of another package raises
            raise PluginError(f"{subject}: {module} cannot be loaded: {_describe(error)}", hint=_UPDATE) from error
        try:
            return attrgetter(name)(found)
        except AttributeError as error:
            raise PluginError(f"{subject} names {reference}, which does not exist", hint=_UPDATE) from error

    @contextmanager
    def importing(self, plugin: P) -> Iterator[None]:
        """Import modules for a plug-in in this context; if one is missing, PluginError names the package to install."""
        try:
            yield
        except ModuleNotFoundError as error:
            raise self._missing_module(f"{self.noun} {plugin.kind!r}", plugin, error.name or "a module") from error

    @contextmanager
    def naming_package(self, kind: str) -> Iterator[None]:
        """Call a plug-in in this context; an unexpected error becomes a PluginError that names the plug-in's package.

        Errors of built-in plug-ins, errors with a ``hint``, and ValueError, which a check may raise, pass unchanged.
        """
        try:
            yield
        except Exception as error:
            package = "" if isinstance(error, ValueError) or hasattr(error, "hint") else self.package_of(kind)
            if not package:
                raise
            raise PluginError(
                f"{self.noun} {kind!r} of the package {package} failed: {_describe(error)}",
                hint="update that package, or report it to its maker; OMOTE_DEBUG=1 prints the traceback",
            ) from error

    def package_of(self, kind: str) -> str:
        """Names and versions of the packages that define a kind, as text; empty for a built-in one."""
        entries = [] if kind in self.builtin() else self._entry_points().get(kind, [])
        return ", ".join(f"{entry.dist.name} {entry.dist.version}" for entry in entries if entry.dist is not None)

    def shadowed(self) -> Iterator[tuple[str, str]]:
        """Yield kind and package of every plug-in that is ignored because omote has its kind or reserves it."""
        taken = {*self.builtin(), *self.reserved}
        for kind, entries in sorted(self._entry_points().items()):
            if kind in taken:
                yield from ((kind, _package_name(entry)) for entry in entries)

    def clear(self) -> None:
        """Forget the loaded plug-ins and the logged messages, as after a package was installed."""
        self._loaded.clear()
        self._logged.clear()

    def _load_builtin(self, reference: str) -> P:
        module, _, name = reference.partition(":")
        found: P = getattr(import_module(module), name or self.attribute)
        return found

    def _missing_module(self, subject: str, plugin: P, name: str) -> PluginError:
        """Return the error for a module that is not found: its package is not installed, or lacks the module."""
        package = name.partition(".")[0]
        if package != name and find_spec(package) is not None:
            return PluginError(f"{subject}: there is no module {name}", hint=_UPDATE)
        needed = plugin.install or package
        return PluginError(
            f"{subject} needs the package {package!r}, which is not installed",
            hint=f'pip install "{needed}"' if "[" in needed else f"pip install {needed}",  # a shell expands brackets
        )

    def _entry_points(self) -> dict[str, list[EntryPoint]]:
        """Entry points of this group by name; packages whose metadata cannot be read are logged once and left out."""
        from importlib.metadata import distributions  # imported lazily: built-in kinds do not need it

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
        """Return the entry point of a kind and the name of its package; PluginError unless there is exactly one."""
        entries = self._entry_points().get(kind, []) if kind not in self.reserved else []
        packages = sorted({_package_name(entry) for entry in entries})
        if not entries:
            known = self.kinds()
            close = difflib.get_close_matches(kind, known, n=1)
            guess = f", did you mean {close[0]!r}?" if close else ""
            raise PluginError(f"unknown {self.noun} {kind!r}{guess}", hint=f"use one of: {', '.join(known)}")
        if len(entries) > 1:
            raise PluginError(
                f"{self.noun} {kind!r} is in more than one package: {', '.join(packages)}",
                hint=f"pip uninstall {packages[-1]}",
            )
        return entries[0], packages[0]

    def _check(self, plugin: Any, kind: str, subject: str, hint: str) -> None:
        made_for = getattr(plugin, "api", None)
        if made_for is not None and made_for != self.version:
            newer = isinstance(made_for, int) and made_for > self.version
            raise PluginError(
                f"{subject} is made for version {made_for} of {self.group}; this omote has version {self.version}",
                hint="pip install --upgrade omote" if newer else hint,
            )
        if not isinstance(plugin, self.definition):
            raise PluginError(f"{subject} must be a {self.definition.__name__}, not {plugin!r}", hint=hint)
        if plugin.kind != kind:
            raise PluginError(f"{subject} says that its kind is {plugin.kind!r}; both must be the same", hint=hint)
        try:
            _check_types(plugin)
            self.check(plugin)
        except Exception as error:
            raise PluginError(f"{subject} cannot be used: {error}", hint=hint) from error

    def _log_once(self, message: str) -> None:
        if message not in self._logged:
            self._logged.add(message)
            log.warning("%s", message)


_UPDATE = "update the package that defines it, or correct its code"


def _check_types(plugin: Any) -> None:
    """Raise ValueError for a field with the wrong type; str, int, bool, type and tuples of str are checked."""
    for name, wanted in get_type_hints(type(plugin)).items():
        value = getattr(plugin, name)
        if get_origin(wanted) is tuple:
            if not isinstance(value, tuple) or not all(isinstance(each, str) for each in value):
                raise ValueError(f"{name} must be a tuple of texts, not {value!r}")
        elif wanted in (str, int, bool, type) and not isinstance(value, wanted):
            raise ValueError(f"{name} must be {wanted.__name__}, not {value!r}")


def _describe(error: BaseException) -> str:
    """Type and message of an error; for a syntax error also its file and line."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__} in {error.filename}, line {error.lineno}: {error.msg}"
    return f"{type(error).__name__}: {error}"


def _package_name(entry: EntryPoint) -> str:
    """Name of the package of an entry point; where it is unknown, the object that the entry point names."""
    return entry.dist.name if entry.dist is not None else entry.value


def folders_with(package: str, module: str) -> dict[str, str]:
    """Sub-packages of ``package`` that have a module called ``module``: the module's full name by sub-package."""
    paths = [path for folder in _folders(package) for path in folder.glob(f"*/{module}.py")]
    return {path.parent.name: f"{package}.{path.parent.name}.{module}" for path in paths}


def modules_in(package: str) -> dict[str, str]:
    """Modules of a package whose names do not begin with an underscore: full name by name."""
    names = [path.stem for folder in _folders(package) for path in folder.glob("[!_]*.py")]
    return {name: f"{package}.{name}" for name in names}


def _folders(package: str) -> list[Path]:
    spec = find_spec(package)
    return [Path(folder) for folder in (spec.submodule_search_locations or ())] if spec else []
