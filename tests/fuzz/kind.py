"""A kind of file that omote reads: good files of it, and what reads them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.outcome import PROCESSOR_S
from tests.fuzz.reading import check, run_command


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    name : of the kind. file : path in a folder under which it is read.
    seeds : good files. read : reads one and returns omote's exit code. beside : files that belong to it.
    words : of the command that reads it, ``{}`` its path; ``omote check`` without.
    most_s : processor time of that command; more where it goes on to fit.
    """

    name: str
    file: str
    seeds: list[bytes]
    read: Callable[[Path], int] = check
    beside: dict[str, bytes] = field(default_factory=dict)
    words: tuple[str, ...] = ()
    most_s: float = PROCESSOR_S

    def lay_out(self, folder: Path) -> Path:
        """Write what belongs to it into a folder; returns the path where it is read itself."""
        path = folder / self.file
        path.parent.mkdir(parents=True, exist_ok=True)
        for name, data in self.beside.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        return path

    def command(self, path: Path) -> int:
        """Run the command that reads it."""
        if not self.words:
            return check(path)
        with tempfile.TemporaryDirectory(prefix="fuzz-") as out:
            given = {"{}": str(path), "{folder}": str(path.parent), "{out}": f"{out}/head"}
            words = self.words
            for name, text in given.items():
                words = tuple(word.replace(name, text) for word in words)
            return run_command(words)


FIT = ("fit", "{}", "-o", "{out}")
FIT_S = 60.0
"""Processor time of a command that goes on to fit what a damaged file still holds; reading it has the usual limit."""
