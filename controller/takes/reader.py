"""Defines what a reader of takes (recorded faces) is, registers all readers, and reads a take of any kind.

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

RECOGNITION_BYTES = 1 << 16
"""Number of bytes at the beginning of a file by which readers recognise it."""

API = 1
"""Version of the interface of readers: this module and :class:`controller.takes.livelink.Take`."""


@dataclass(frozen=True, kw_only=True)
class TakeReader:
    """A reader of one kind of files.

    api : version of the registry that the reader is made for; see :data:`API`.
    kind : a short name. title : the name of such files for people.
    suffixes : file name suffixes in lower case, such as ``.csv``.
    read : ``"module:name"`` of a function that takes a path and the parameters and returns a
        :class:`controller.takes.livelink.Take`, or raises TakeError.
    layer : the layer that the takes play into: ``"capture"`` for a whole face, ``"speech"`` for only a mouth.
    install : argument of ``pip install`` if a package is missing.
    recognises : ``"module:name"`` of a function that returns, for the first :data:`RECOGNITION_BYTES` bytes of a file,
        whether it is of this kind. Readers with such a function may share suffixes with others. They are tried in
        order, built-in ones first; a file that none of them recognises goes to the reader without one, if there is one.
    """

    api: int
    kind: str
    title: str
    suffixes: tuple[str, ...]
    read: str
    layer: str = "capture"
    install: str = ""
    recognises: str = ""


def _built_in() -> dict[str, str]:
    return modules_in("controller.takes.readers")


def _check(reader: TakeReader) -> None:
    """Raise ValueError for invalid suffixes, and for those of a built-in kind unless ``recognises`` is given."""
    built_in = _built_in()
    others = [] if reader.kind in built_in else [TAKES.get(kind) for kind in built_in]
    taken = {suffix: other.kind for other in others for suffix in other.suffixes}
    for suffix in reader.suffixes:
        if not suffix.startswith(".") or suffix != suffix.lower():
            raise ValueError(f"suffixes must begin with a dot and be in lower case, not {suffix!r}")
        if suffix in taken and not reader.recognises:
            raise ValueError(f"{suffix} is read by the built-in kind {taken[suffix]!r}; with `recognises` both read it")


TAKES: Registry[TakeReader] = Registry(TakeReader, "take", "omote.takes", API, _built_in, "TAKE", check=_check)


def suffixes() -> list[str]:
    """Return the file name suffixes of all readers, each once."""
    return list(dict.fromkeys(suffix for reader in TAKES.all() for suffix in reader.suffixes))


def reader_of(path: Path) -> TakeReader:
    """Return the reader of a file, by its suffix and, if several readers have that, by its first bytes.

    Raises TakeError: there is no such reader, or the file cannot be read. PluginError: a package that is needed to
    recognise the file is not installed.
    """
    kind = path.suffix.lower()
    fitting = [reader for reader in TAKES.all() if kind in reader.suffixes]
    if not fitting:
        *most, last = suffixes()
        hint = f"use {', '.join(most)} or {last}"
        raise TakeError(f"{path}: not a take: its name ends in {kind or 'nothing'}", hint=hint)
    found = fitting[0] if len(fitting) == 1 else _recognise(path, fitting)
    if found is None:
        titles = "; ".join(reader.title for reader in fitting)
        raise TakeError(f"{path}: not a {kind} file that omote knows", hint=f"these {kind} files are read: {titles}")
    return found


def _recognise(path: Path, readers: list[TakeReader]) -> TakeReader | None:
    """Return the first reader that recognises a file, else the first one that reads its suffix unconditionally."""
    with files.reading(path, TakeError), files.open_file(path) as file:
        start = file.read(RECOGNITION_BYTES)
    for reader in readers:
        if reader.recognises:
            recognises = TAKES.load(reader, reader.recognises)
            with TAKES.naming_package(reader.kind):
                if recognises(start):
                    return reader
    return next((reader for reader in readers if not reader.recognises), None)


def load_take(path: Path, parameters: Parameters) -> Take:
    """Read a take of any kind that omote reads.

    Raises TakeError: the file cannot be read or is invalid. PluginError: a package that it needs is not installed.
    """
    reader = reader_of(path)
    read = TAKES.load(reader, reader.read)
    with TAKES.naming_package(reader.kind):
        take = read(path, parameters)
    if not isinstance(take, Take):
        raise TakeError(f"{path}: take kind {reader.kind!r} gave no take, but {take!r}", hint="update its package")
    return take
