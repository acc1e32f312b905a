"""Shared by the readers of surface files: named surfaces, errors that name the place in a file, reading of bytes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.errors import SurfaceFileError
from surface.base.files import DATA_LIMIT, TEXT_LIMIT, decode, read_file, reading
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain

#: Takes the error of a part of a file that is left out.
LeaveOut = Callable[[SurfaceFileError], None]


@dataclass(frozen=True)
class Ties:
    """Control points (n) that follow fewer of a file (m): sums of shares of these.

    row, column : (k,) int64, control point and point of the file; share : (k,) float64; count : n.
    points : (m, 3) float64, those of the file.
    """

    row: Ints
    column: Ints
    share: Floats
    count: int
    points: Floats

    @classmethod
    def of(cls, rows: Sequence[Mapping[int, float]], points: Mapping[int, Floats]) -> Ties:
        """Make ties from each control point's shares by the file's number, and the file's points by number."""
        column = {number: k for k, number in enumerate(sorted(points))}
        every = [(k, column[number], share) for k, row in enumerate(rows) for number, share in row.items()]
        at, of, shares = zip(*every, strict=True)
        own = np.array([points[number] for number in column])
        return cls(np.array(at), np.array(of), np.array(shares), len(rows), own)

    def apply(self, values: Floats) -> Floats:
        """Return (n, c): values of the control points for those of the file's points (m, c)."""
        out = np.zeros((self.count, values.shape[1]))
        np.add.at(out, self.row, self.share[:, None] * values[self.column])
        return out


@dataclass(frozen=True)
class NamedSurface:
    """One surface of a file.

    name : as the file has it, or made from its place in the file
    domain : where to draw it; None for everywhere it is covered
    ties : how its control points follow those of the file, where they are not the same
    deviation : greatest distance of what is fitted, as at star points of a T-spline, from what it is fitted to; else 0
    seams : borders of the domain that are one line in space, as polylines (k, 2) of equal points on either side; the
        second one follows the first. Two equal points are a corner.
    """

    name: str
    surface: DCPSurface
    domain: Domain | None = None
    ties: Ties | None = None
    deviation: float = 0.0
    seams: tuple[tuple[Floats, Floats], ...] = ()


def summary(item: NamedSurface) -> str:
    """Return one line that describes a surface: control points, degrees, domain, trim loops and slits."""
    surface, domain = item.surface, item.domain
    degrees = " x ".join("/".join(map(str, np.unique(p))) for p in surface.degrees)
    u0, u1, v0, v1 = surface.rect if domain is None else domain.rect
    parts = [f"{surface.n} control points", f"degree {degrees}", f"u {u0:g} to {u1:g}", f"v {v0:g} to {v1:g}"]
    parts += [f"closed in {axis}" for axis, ends in zip("uv", surface.closed, strict=True) if ends is not None]
    if domain is not None:
        counts = (("trim loop", len(domain.loops)), ("slit", len(domain.slits)))
        parts += [f"{count} {word}{'s' * (count > 1)}" for word, count in counts if count]
    parts += [f"fitted near star points within {item.deviation:.3g}"] if item.deviation > 0 else []
    return f"{item.name}: {', '.join(parts)}"


@dataclass(frozen=True)
class Location:
    """A file and a place in it, such as a line or an element, for error messages."""

    path: Path
    where: str = ""

    def at(self, where: str) -> Location:
        """Return another place in the same file."""
        return Location(self.path, where)

    def child(self, where: str) -> Location:
        """Return a place inside this one: ``where`` is appended."""
        return Location(self.path, self.where + where)

    def error(self, why: str, *, hint: str = "") -> SurfaceFileError:
        """Return the error to raise for this place."""
        place = f"{self.path}, {self.where}" if self.where else str(self.path)
        return SurfaceFileError(f"{place}: {why}", hint=hint or "export the file again, or take it from a copy")


def read_text(path: Path, errors: str = "strict") -> str:
    """Return a file's content as UTF-8; ``SurfaceFileError`` where it cannot be read."""
    data = read_bytes(path, TEXT_LIMIT)
    try:
        return decode(data) if errors == "strict" else data.decode("utf-8-sig", errors)
    except ValueError as error:
        raise Location(path).error(f"is {error}") from error


def read_bytes(path: Path, limit: int = DATA_LIMIT) -> bytes:
    """Return a file's content; ``SurfaceFileError`` where it cannot be read."""
    with reading(path, SurfaceFileError):
        return read_file(path, limit)
