"""Defines what a reader of takes is, registers all readers, and reads a take of any kind.

A reader is a module in ``controller/takes/readers`` that holds ``TAKE``, or another package with an entry
point in the group ``omote.takes`` that names a :class:`TakeReader`; see docs/extending.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from controller.base.errors import TakeError
from controller.base.parameters import Parameters
from controller.takes.livelink import Take
from drivers.base.plugins import Registry, modules_in
from surface.base import files

BEGINNING = 1 << 16
"""Bytes at the beginning of a file by which readers recognise it."""

API = 1
"""Version of what a reader must keep: this module and :class:`controller.takes.livelink.Take`."""


@dataclass(frozen=True, kw_only=True)
class TakeReader:
    """One sort of files.

    api : version of the registry it is made for; see :data:`API`.
    kind : a short name. title : the name of such files for people.
    suffixes : how their names end, in small letters.
    read : ``"module:name"`` of a function that takes a path and the parameters and gives a
        :class:`controller.takes.livelink.Take`, or raises TakeError.
    layer : the layer they play into: ``"capture"`` for what moves all of the face, ``"speech"`` for what leaves the
        rest of it alone.
    install : what ``pip install`` takes where a package is missing.
    recognises : ``"module:name"`` of a function that says by the first :data:`BEGINNING` bytes of a file whether it is
        of this kind. Readers that have one may share suffixes with others. They are asked one after another, built-in
        ones first; a file that none of them recognises is for the reader without one, if there is such a reader.
    """

    api: int
    kind: str
    title: str
    suffixes: tuple[str, ...]
    read: str
    layer: str = "capture"
    install: str = ""
    recognises: str = ""


def _own() -> dict[str, str]:
    return modules_in("controller.takes.readers")


def _check(reader: TakeReader) -> None:
    """ValueError for suffixes that are none, or that files of a built-in kind have."""
    own = _own()
    others = [] if reader.kind in own else [TAKES.get(kind) for kind in own]
    taken = {suffix: other.kind for other in others for suffix in other.suffixes}
    for suffix in reader.suffixes:
        if not suffix.startswith(".") or suffix != suffix.lower():
            raise ValueError(f"suffixes must begin with a dot and be in small letters, not {suffix!r}")
        if suffix in taken and not reader.recognises:
            raise ValueError(f"{suffix} is read by the built-in kind {taken[suffix]!r}; with `recognises` both read it")


TAKES: Registry[TakeReader] = Registry(TakeReader, "take", "omote.takes", API, _own, "TAKE", check=_check)


def suffixes() -> list[str]:
    """How the names of all takes end, each once."""
    return list(dict.fromkeys(suffix for reader in TAKES.all() for suffix in reader.suffixes))


def reader_of(path: Path) -> TakeReader:
    """The reader of a file, by the ending of its name and, where several readers have that, by its first bytes.

    Raises TakeError: there is none, or the file cannot be read. PluginError: a package is needed to recognise it.
    """
    kind = path.suffix.lower()
    fitting = [reader for reader in TAKES.all() if kind in reader.suffixes]
    if not fitting:
        *most, last = suffixes()
        hint = f"use {', '.join(most)} or {last}"
        raise TakeError(f"{path}: no take: its name ends in {kind or 'nothing'}", hint=hint)
    found = fitting[0] if len(fitting) == 1 else _recognised(path, fitting)
    if found is None:
        sorts = "; ".join(reader.title for reader in fitting)
        raise TakeError(f"{path}: no {kind} file that omote knows", hint=f"these {kind} files are read: {sorts}")
    return found


def _recognised(path: Path, readers: list[TakeReader]) -> TakeReader | None:
    """The first reader that recognises a file, else the one that does not look."""
    with files.reading(path, TakeError), files.open_file(path) as file:
        start = file.read(BEGINNING)
    for reader in readers:
        if reader.recognises:
            recognises = TAKES.load(reader, reader.recognises)
            with TAKES.naming_package(reader.kind):
                if recognises(start):
                    return reader
    return next((reader for reader in readers if not reader.recognises), None)


def load_take(path: Path, parameters: Parameters) -> Take:
    """A take of any kind omote reads.

    Raises TakeError: the file cannot be read or is wrong. PluginError: a package that it needs is not installed.
    """
    reader = reader_of(path)
    read = TAKES.load(reader, reader.read)
    with TAKES.naming_package(reader.kind):
        take = read(path, parameters)
    if not isinstance(take, Take):
        raise TakeError(f"{path}: take kind {reader.kind!r} gave no take, but {take!r}", hint="update its package")
    return take
