"""Identities: named variations of a head's rest shape (control points, eyes, jaw hinge), read from ``identities.npz``
in its folder and mixed into it before it moves."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from surface.base.arrays import Array, Floats, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.sidecar import Sidecar, read_sidecar, sidecar_path, write_sidecar

FILE = "identities.npz"


@dataclass(frozen=True)
class Identity:
    """One variation, per unit.

    groups : part name -> displacements of control points at rest, mm.
    changes : part name -> what is added to groups of the head, so that lids of another height still close.
    eyes : (2, 3) shift of the eyeballs' centres; jaw : (3,) of the hinge, mm.
    fit : :func:`fingerprint` of the head it was made for.
    """

    name: str
    groups: dict[str, Group]
    changes: dict[str, list[Group]]
    eyes: Floats
    jaw: Floats
    fit: int


def fingerprint(head: HeadData) -> int:
    """Return CRC-32 over the knots of all control points of a head."""
    out = 0
    for part in head.parts:
        for knots in (part.knots_u, part.knots_v):
            out = zlib.crc32(np.ascontiguousarray(knots, np.float64).tobytes(), out)
    return out


def load_identities(head: str | Path) -> dict[str, Identity]:
    """Return the identities of a head, given by its folder or its head.toml, by name; empty where it has none.

    A start asks for them several times; they are read again only when the file has changed.

    Raises HeadFileError: the file is damaged or of a newer version.
    """
    path = sidecar_path(head, FILE)
    try:
        found = path.stat()
    except OSError:
        return _read(path, ())  # which says what is wrong with it
    return dict(_read_once(path, (found.st_ino, found.st_mtime_ns, found.st_size)))


def _read(path: Path, stamp: tuple[int, ...]) -> dict[str, Identity]:
    """The identities of a file, whose ``stamp`` changes when it does."""
    hint = "make it again: omote fit MESH -o FOLDER --keep --identities FILE"
    return read_sidecar(path, _identities, hint) or {}


_read_once = lru_cache(maxsize=2)(_read)


def _identities(file: Sidecar) -> dict[str, Identity]:
    z = file.arrays
    names = [str(n) for n in z["names"]]
    eyes, jaw = _finite(z["eyes"], (len(names), 2, 3)), _finite(z["jaw"], (len(names), 3))
    out = {}
    for k, name in enumerate(names):
        groups = {part: Group(name, *rows) for part, rows in _moves(z, f"{k}/ids/", f"{k}/moves/").items()}
        changes: dict[str, list[Group]] = {}
        for key, rows in _moves(z, f"{k}/change_ids/", f"{k}/change_moves/").items():
            part, shape = key.rsplit("/", 1)
            changes.setdefault(part, []).append(Group(shape, *rows))
        out[name] = Identity(name, groups, changes, eyes[k], jaw[k], int(z["fit"]))
    return out


def _moves(z: Mapping[str, Array], ids_prefix: str, moves_prefix: str) -> dict[str, tuple[Array, Floats32]]:
    """Return control points and their displacements, by what follows the prefixes of their keys."""
    out = {}
    for key in z:
        if key.startswith(ids_prefix):
            name, ids = key.removeprefix(ids_prefix), z[key]
            if ids.ndim != 1 or ids.dtype.kind not in "iu" or ids.min(initial=0) < 0 or ids.max(initial=0) >= 2**31:
                raise ValueError("an array of control points holds something else")
            moves = _finite(z[moves_prefix + name], (len(ids), 3)).astype(np.float32)
            out[name] = ids.astype(np.int32), moves
    return out


def _finite(a: Array, shape: tuple[int, ...]) -> Floats:
    if a.shape != shape or not np.isfinite(a).all():
        raise ValueError(f"an array has shape {a.shape}, expected {shape}, or is not finite")
    return a.astype(np.float64)


def save_identities(head: str | Path, identities: list[Identity]) -> Path:
    """Write identities to the head's folder; returns the file's path."""
    arrays: dict[str, Array] = {
        "fit": np.array(identities[0].fit if identities else 0, np.int64),
        "names": np.array([i.name for i in identities]),
        "eyes": np.array([i.eyes for i in identities]).reshape(-1, 2, 3),
        "jaw": np.array([i.jaw for i in identities]).reshape(-1, 3),
    }
    for k, identity in enumerate(identities):
        for part, group in identity.groups.items():
            arrays |= {f"{k}/ids/{part}": group.ids, f"{k}/moves/{part}": group.moves}
        for part, changes in identity.changes.items():
            for g in changes:
                arrays |= {f"{k}/change_ids/{part}/{g.name}": g.ids, f"{k}/change_moves/{part}/{g.name}": g.moves}
    return write_sidecar(sidecar_path(head, FILE), arrays)


def with_identities(head: HeadData, known: Mapping[str, Identity], wanted: Mapping[str, float], where: str) -> HeadData:
    """Return the head with identities mixed in, each by 0 to 1.

    Raises HeadFileError: no identity of that name, an amount out of range, or one that was made for another fit.
    """
    eyes, jaw = head.eyes.copy(), np.array(head.jaw.centre, float)
    parts = {p.name: p for p in head.parts}
    for name, amount in wanted.items():
        if name not in known:
            there = ", ".join(known) or "none"
            raise HeadFileError(
                f"{where}: no identity {name!r}; there are {there}",
                hint="omote fit --help describes how --identities adds some",
            )
        if not (math.isfinite(amount) and 0.0 <= amount <= 1.0):
            raise HeadFileError(f"{where}: identity {name}: {amount:g} is not between 0 and 1", hint=f"{name}=0.6")
        identity = known[name]
        _check_fit(head, identity, where)
        eyes += amount * identity.eyes
        jaw += amount * identity.jaw
        for part, group in identity.groups.items():
            points = parts[part].points.copy()
            points[group.ids] += amount * group.moves
            parts[part] = replace(parts[part], points=points)
        for part, changes in identity.changes.items():
            for group in changes:
                parts[part] = _add_change(parts[part], group, amount)
    moved = replace(head.jaw, centre=tuple(jaw.tolist()))
    return replace(head, eyes=eyes, jaw=moved, parts=[parts[p.name] for p in head.parts])


def _check_fit(head: HeadData, identity: Identity, where: str) -> None:
    points = {p.name: len(p.points) for p in head.parts}
    every = [*identity.groups.items(), *((p, g) for p, groups in identity.changes.items() for g in groups)]
    inside = all(group.ids.max(initial=-1) < points.get(part, -1) for part, group in every)
    if identity.fit != fingerprint(head) or not inside:
        raise HeadFileError(f"{where}: identities.npz was made for another fit of this head",
                            hint="make it again: omote fit MESH -o FOLDER --keep --identities FILE")  # fmt: skip


def _add_change(part: PartData, change: Group, amount: float) -> PartData:
    """Return the part with a multiple of ``change`` added to its group of the same name."""
    total = np.zeros((len(part.points), 3), np.float32)
    total[change.ids] += np.float32(amount) * change.moves
    for g in part.groups:
        if g.name == change.name:
            total[g.ids] += g.moves
    ids = np.flatnonzero(np.abs(total).max(axis=1) > 0).astype(np.int32)
    others = [g for g in part.groups if g.name != change.name]
    return replace(part, groups=[*others, Group(change.name, ids, total[ids])])
