"""The surfaces of a file as pieces of a head: which are taken, what they are called, how they are sampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.errors import FitError, SurfaceFileError
from surface.dcp import DCPSurface
from surface.fit.source.kinds import kind_of, listed
from surface.fit.source.mesh import LARGE, SMALL
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh
from surface.readers import NamedSurface, Ties, read_surface

CHORD_ERROR = 1.5e-3  # of the samples, relative to the whole file's size
MAX_DEPTH = 6  # of the samples' quad trees


@dataclass(frozen=True)
class Piece:
    """One surface of a file, in the file's coordinates.

    name : unique, and without "/"; title : as the file has it. material : by which a head draws it.
    chord : how near its samples are to it, in the file's unit. ties, deviation, seams : as
    of :class:`surface.readers.NamedSurface`.
    """

    name: str
    title: str
    material: str
    surface: DCPSurface
    domain: Domain
    chord: float
    ties: Ties | None = None
    deviation: float = 0.0
    seams: tuple[tuple[Floats, Floats], ...] = ()

    @cached_property
    def mesh(self) -> Mesh:
        """Its samples: triangles run as S_u x S_v says."""
        with np.errstate(divide="ignore", invalid="ignore"):  # triangles without area while borders are cut
            return self.surface.tessellate(chord_error=self.chord, max_depth=MAX_DEPTH, domain=self.domain)


def read_pieces(
    path: str | Path, without: Sequence[str] = (), only: Sequence[str] = (), *, strict: bool = False
) -> tuple[list[Piece], list[str]]:
    """The surfaces of a file that are a head's own, and what was left out, in words.

    without, only : surfaces by name, whole or a part of it. strict : nothing that cannot be read is left out.

    Raises SurfaceFileError: the file cannot be read, or holds no surface that can. FitError: a name fits none.
    """
    errors: list[SurfaceFileError] = []
    items = read_surface(path, None if strict else errors.append)
    notes = [f"left out, cannot be read: {error}" for error in errors]
    items = _chosen(items, without, only, str(path))
    if not only:
        items, worn = _own(items)
        notes += worn
    return make_pieces(items, str(path)), notes


def _chosen(items: list[NamedSurface], without: Sequence[str], only: Sequence[str], where: str) -> list[NamedSurface]:
    """What the user asked for by names."""
    wanted = set().union(*(_named(items, word, "--only", where) for word in only)) if only else set(range(len(items)))
    unwanted = set().union(*(_named(items, word, "--without", where) for word in without))
    kept = [item for k, item in enumerate(items) if k in wanted - unwanted]
    if not kept:
        raise FitError(f"{where}: nothing is left of it", hint="leave out less by --without, or name more by --only")
    return kept


def _named(items: list[NamedSurface], word: str, option: str, where: str) -> set[int]:
    """Places of the surfaces of that name, or else of those whose names hold it."""
    names = [item.name.lower() for item in items]
    found = {k for k, name in enumerate(names) if name == word.lower()}
    found = found or {k for k, name in enumerate(names) if word.lower() in name}
    if not found:
        raise FitError(
            f"{option} {word}: {where} holds {listed([item.name for item in items])}", hint="take one of them"
        )
    return found


def _own(items: list[NamedSurface]) -> tuple[list[NamedSurface], list[str]]:
    """Surfaces that are not named as clothes, hats or glasses, and notes on the others."""
    out: dict[str, list[str]] = {}
    for item in items:
        if (kind := kind_of(item.name)).rule == "out":
            out.setdefault(kind.name, []).append(item.name)
    kept = [item for item in items if kind_of(item.name).rule != "out"]
    notes = [f"{kind} left out: {listed(names)} (--only NAME keeps it)" for kind, names in out.items()]
    return (kept, notes) if kept else (items, [])


def make_pieces(items: Sequence[NamedSurface], where: str) -> list[Piece]:
    """Pieces of surfaces; those that have nothing to draw are an error.

    Raises FitError: no surface, one of a size that no head has, or one of which nothing is covered.
    """
    if not items:
        raise FitError(f"{where}: holds no surface", hint="give at least one")
    size = max(float(np.ptp(item.surface.points, axis=0).max()) for item in items)
    largest = max(float(np.abs(item.surface.points).max()) for item in items)
    if not SMALL < size <= largest * 2 <= 2 * LARGE:
        why = f"{where}: its control points span {size:.3g} and lie up to {largest:.3g} from the origin"
        raise FitError(f"{why}; no head does", hint="export it in another unit, near the origin")
    names = _unique([item.name.replace("/", " ").strip() or "surface" for item in items])
    out = []
    for item, name in zip(items, names, strict=True):
        domain = item.domain or Domain(item.surface.rect)
        material = kind_of(item.name).material
        fitted = item.ties, item.deviation, item.seams
        piece = Piece(name, item.name, material, item.surface, domain, CHORD_ERROR * size, *fitted)
        if not len(piece.mesh.triangles):
            raise FitError(f"{where}: {item.name!r} covers nothing of its domain", hint=f"--without '{item.name}'")
        out.append(piece)
    return out


def _unique(names: list[str]) -> list[str]:
    """The names, numbered from the second of one name on."""
    out: list[str] = []
    for name in names:
        k, new = 2, name
        while new in out:
            k, new = k + 1, f"{name} {k}"
        out.append(new)
    return out


def with_face(pieces: list[Piece], face: int) -> list[Piece]:
    """The pieces with one called "face", which tools look for by that name, in the first place."""
    others = [replace(p, name=f"{p.name} 2") if p.name == "face" else p for k, p in enumerate(pieces) if k != face]
    return [replace(pieces[face], name="face"), *others]


def joined(pieces: Sequence[Piece]) -> tuple[Floats, Ints]:
    """Samples of all pieces: points (n, 3) in the file's coordinates, triangles (t, 3)."""
    first = np.cumsum([0, *(len(p.mesh.vertices) for p in pieces)])
    points = np.concatenate([p.mesh.vertices for p in pieces])
    return points, np.concatenate([p.mesh.triangles + k for p, k in zip(pieces, first, strict=False)]).astype(np.int64)
