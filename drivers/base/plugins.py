"""Plug-ins: families, links and the like, which are found and not listed.

A plug-in is a small frozen dataclass at module level that says what it is and names, as ``"module:name"``, what does
the work. The built-in ones are found by their folder, those of other packages by an entry point whose name is their
kind. A definition imports next to nothing, so that all of them can be listed at once; what it names is imported when
somebody asks for it.
"""

from __future__ import annotations

import difflib
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import reduce
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, get_origin, get_type_hints

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
    reserved : kinds that no package may add.
    check : raises PluginError for a definition of another package that this sort cannot use.

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
        reserved: Iterable[str] = (),
        check: Callable[[P], None] = lambda plugin: None,
    ) -> None:
        self._sort, self.what, self.group, self.version = sort, what, group, version
        self._builtin, self._attribute, self._reserved, self._check_own = builtin, attribute, tuple(reserved), check
        self._loaded: dict[str, P] = {}
        self._told: set[str] = set()

    def kinds(self) -> list[str]:
        """Every kind that is installed, whether or not it can be loaded, in order."""
        return sorted({*self._builtin(), *self._foreign()} - set(self._reserved))

    def all(self) -> list[P]:
        """Every plug-in that can be loaded: the built-in ones in the order of their kinds, then the others."""
        found = []
        own = self._builtin()
        for kind in sorted(self.kinds(), key=lambda kind: (kind not in own, kind)):
            try:
                found.append(self.get(kind))
            except PluginError as error:
                self._tell(str(error))
        return found

    def get(self, kind: str) -> P:
        """The plug-in of a kind.

        Raises
        ------
        PluginError : nothing of that kind is installed, or it cannot be loaded.
        """
        if kind not in self._loaded:
            module = self._builtin().get(kind)
            self._loaded[kind] = self._foreign_one(kind) if module is None else self._own(kind, module)
        return self._loaded[kind]

    def load(self, plugin: P, reference: str) -> Any:
        """What a plug-in names as ``"module:name"``.

        Raises
        ------
        PluginError : a package that it needs is not installed, its module cannot be loaded, or there is nothing of
            that name.
        """
        module, _, name = reference.partition(":")
        mine = f"{self.what} {plugin.kind!r}"
        try:
            found = import_module(module)
        except ModuleNotFoundError as error:
            raise self._missing(mine, plugin, error.name or module) from error
        except (Exception, SystemExit) as error:  # whatever a foreign module does
            raise PluginError(f"{mine}: {module} cannot be loaded: {_why(error)}", hint=_UPDATE) from error
        try:
            return reduce(getattr, name.split("."), found)
        except AttributeError as error:
            raise PluginError(f"{mine} names {reference}, and there is nothing of that name", hint=_UPDATE) from error

    @contextmanager
    def blaming(self, kind: str) -> Iterator[None]:
        """Around what calls a plug-in: an error that another package did not mean to raise names the package.

        Errors that say what to do (with a ``hint``) and ValueError, which a check may raise, go through as they are.
        """
        try:
            yield
        except Exception as error:
            package = "" if isinstance(error, ValueError) or hasattr(error, "hint") else self.package_of(kind)
            if not package:
                raise
            raise PluginError(
                f"{self.what} {kind!r} of the package {package} failed: {_why(error)}",
                hint="update that package, or tell its maker; OMOTE_DEBUG=1 shows where it was",
            ) from error

    def package_of(self, kind: str) -> str:
        """Names and versions of the packages a kind comes from; empty for a built-in one."""
        entries = [] if kind in self._builtin() else self._foreign().get(kind, [])
        return ", ".join(f"{entry.dist.name} {entry.dist.version}" for entry in entries if entry.dist is not None)

    def shadowed(self) -> Iterator[tuple[str, str]]:
        """Kinds that packages add in vain, for omote has them itself, and the name of the package."""
        taken = {*self._builtin(), *self._reserved}
        for kind, entries in sorted(self._foreign().items()):
            if kind in taken:
                yield from ((kind, _package(entry)) for entry in entries)

    def forget(self) -> None:
        """Look for everything again, as after another package was installed."""
        self._loaded.clear()
        self._told.clear()

    def _missing(self, mine: str, plugin: P, name: str) -> PluginError:
        """What is said of a module that is not there, by whether its package is."""
        package = name.partition(".")[0]
        if package != name and find_spec(package) is not None:
            return PluginError(f"{mine}: there is no module {name}", hint=_UPDATE)
        return PluginError(
            f"{mine} needs the package {package!r}, which is not installed",
            hint=f"pip install {_quoted(plugin.install) or package}",
        )

    def _own(self, kind: str, module: str) -> P:
        """A plug-in in a folder of omote's own."""
        mine = f"{self.what} {kind!r} in {module}"
        try:
            plugin: P = getattr(import_module(module), self._attribute)
        except Exception as error:
            raise PluginError(f"{mine} cannot be loaded: {_why(error)}", hint=f"mend {module}") from error
        self._check(plugin, kind, mine, f"mend {module}")
        return plugin

    def _foreign(self) -> dict[str, list[EntryPoint]]:
        """Entry points of this group by name; what cannot be read of a package is told once and left out."""
        from importlib.metadata import distributions  # start-up: built-in kinds are found without it

        found: dict[str, dict[tuple[str, str], EntryPoint]] = {}
        for package in distributions():
            try:
                entries = [entry for entry in package.entry_points if entry.group == self.group]
                for entry in entries:
                    found.setdefault(entry.name, {}).setdefault((package.name, entry.value), entry)
            except Exception as error:  # noqa: BLE001  a package with a damaged list breaks nothing but itself
                self._tell(f"the entry points of {package} cannot be read: {type(error).__name__}: {error}")
        return {name: [*entries.values()] for name, entries in found.items()}

    def _foreign_one(self, kind: str) -> P:
        entries = self._foreign().get(kind, []) if kind not in self._reserved else []
        if not entries:
            raise self._unknown(kind)
        packages = sorted({_package(entry) for entry in entries})
        if len(entries) > 1:
            raise PluginError(
                f"{self.what} {kind!r} is in more than one package: {', '.join(packages)}",
                hint=f"pip uninstall {packages[-1]}",
            )
        mine = f"{self.what} {kind!r} of the package {packages[0]}"
        try:
            plugin: P = entries[0].load()
        except (Exception, SystemExit) as error:  # whatever a foreign module does, it must break nothing but itself
            raise PluginError(
                f"{mine} cannot be loaded: {_why(error)}", hint=f"pip install --upgrade {packages[0]}"
            ) from error
        self._check(plugin, kind, mine, f"pip install --upgrade {packages[0]}, or ask its maker")
        return plugin

    def _check(self, plugin: Any, kind: str, mine: str, hint: str) -> None:
        made_for = getattr(plugin, "api", None)
        if made_for is not None and made_for != self.version:
            newer = isinstance(made_for, int) and made_for > self.version
            raise PluginError(
                f"{mine} is made for version {made_for} of {self.group}; this omote has version {self.version}",
                hint="pip install --upgrade omote" if newer else hint,
            )
        if not isinstance(plugin, self._sort):
            raise PluginError(f"{mine} must be a {self._sort.__name__}, not {plugin!r}", hint=hint)
        if plugin.kind != kind:
            raise PluginError(f"{mine} says that its kind is {plugin.kind!r}; both must be the same", hint=hint)
        try:
            _check_types(plugin)
            self._check_own(plugin)
        except Exception as error:
            raise PluginError(f"{mine} cannot be used: {error}", hint=hint) from error

    def _tell(self, message: str) -> None:
        if message not in self._told:
            self._told.add(message)
            log.warning("%s", message)

    def _unknown(self, kind: str) -> PluginError:
        known = self.kinds()
        close = difflib.get_close_matches(kind, known, n=1)
        guess = f", did you mean {close[0]!r}?" if close else ""
        return PluginError(f"unknown {self.what} {kind!r}{guess}", hint=f"use one of: {', '.join(known)}")


_UPDATE = "update the package that it comes from, or mend it"


def _check_types(plugin: Any) -> None:
    """ValueError for a field of a definition that is not of its type; those that are plain types are looked at."""
    for name, kind in get_type_hints(type(plugin)).items():
        value = getattr(plugin, name)
        if get_origin(kind) is tuple:
            if not isinstance(value, tuple) or not all(isinstance(each, str) for each in value):
                raise ValueError(f"{name} must be a tuple of texts, not {value!r}")
        elif kind in (str, int, bool, type) and not isinstance(value, kind):
            raise ValueError(f"{name} must be {kind.__name__}, not {value!r}")


def _why(error: BaseException) -> str:
    """An error in words, with the file and line of one in the source."""
    where = f" in {error.filename}, line {error.lineno}" if isinstance(error, SyntaxError) else ""
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}{where}: {said}"


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else entry.value


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
