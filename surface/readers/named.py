"""What every reader gives back, and how readers say what is wrong."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from surface.dcp import DCPSurface
from surface.domain import Domain
from surface.errors import SurfaceFileError


@dataclass(frozen=True)
class NamedSurface:
    """One surface of a file.

    Attributes
    ----------
    name : as the file has it, or made from its place in the file
    surface : the surface
    domain : where to draw it; None for everywhere it is covered
    """

    name: str
    surface: DCPSurface
    domain: Domain | None = None


class Place:
    """A file and a place in it, for error messages."""

    def __init__(self, path: Path, where: str = "") -> None:
        self.path, self.where = path, where

    def at(self, where: str) -> Place:
        """The same file, another place."""
        return Place(self.path, where)

    def error(self, why: str, *, hint: str = "") -> SurfaceFileError:
        """The error to raise."""
        place = f"{self.path}, {self.where}" if self.where else str(self.path)
        return SurfaceFileError(f"{place}: {why}", hint=hint or "export the file again, or take it from a copy")


def read_text(path: Path, errors: str = "strict") -> str:
    """The file as UTF-8; ``SurfaceFileError`` where it cannot be read."""
    try:
        return read_bytes(path).decode("utf-8", errors)
    except UnicodeDecodeError as error:
        raise Place(path).error(f"is not text (byte {error.start}: {error.reason})") from error


def read_bytes(path: Path) -> bytes:
    """The file; ``SurfaceFileError`` where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise Place(path).error(f"cannot be read: {error.strerror}", hint=f"look at: ls -l {path}") from error
