"""Read and write a head's folder: ``head.toml`` (what a user may edit) and ``head.npz`` (control points and groups)."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from surface.base import files
from surface.base.arrays import Array, Floats
from surface.base.errors import HeadFileError
from surface.head.model.data import Contact, Group, HeadData, Jaw, Neck, PartData, Rule, Seal, Seam
from surface.head.model.meshes import KEYS
from surface.head.model.parameters import SHAPES
from surface.head.model.placement import Placement
from surface.mesh.domain import Slit

VERSION = 2
PLAIN = 1  # version of heads whose parts are neither closed nor flipped and have no rectangle: older omotes read them
ANY = -1  # in a shape: an axis of any length
ARRAYS: dict[str, tuple[int | str, ...]] = {  # key of a part: its array's shape; "n" is the number of control points
    "points": ("n", 3), "weights": ("n",), "knots_u": ("n", ANY), "knots_v": ("n", ANY), "degrees": ("n", 2),
    "loops": (ANY, 2), "loop_ends": (ANY,), "slits": (ANY, 3), "group_ids": (ANY,), "group_ends": (ANY,),
    "group_moves": (ANY, 3), "jaw": ("n",), "lids": ("n",),
}  # fmt: skip
TYPES: dict[str, type[np.number[Any]]] = {  # of the last word of a key; float64 for others
    "degrees": np.int8, "loop_ends": np.int32, "group_ids": np.int32, "group_ends": np.int32, "group_moves": np.float32,
}  # fmt: skip


HINT = "restore the file or make the head again: omote fit"


def _error(path: Path, key: str, why: str) -> HeadFileError:
    return HeadFileError(f"{path}: {key}: {why}", hint=HINT)


def _check(path: Path, key: str, a: Array, shape: tuple[int, ...]) -> Array:
    if a.ndim != len(shape) or any(w not in (ANY, g) for g, w in zip(a.shape, shape, strict=True)):
        raise _error(path, key, f"has shape {a.shape}, expected {shape}".replace("-1", "any"))
    if a.dtype.kind not in "fiu" or not np.isfinite(a).all():
        raise _error(path, key, "holds something that is not a finite number")
    return a


@dataclass(frozen=True)
class _Section:
    """A table of head.toml; every error names the file and the key, which ``where`` is the beginning of."""

    path: Path
    table: dict[str, Any]
    where: str = ""

    def error(self, key: str, why: str) -> HeadFileError:
        return _error(self.path, self.where + key, why)

    def read(self, **wanted: type | tuple[int, ...]) -> dict[str, Any]:
        """Return values by key, each of a type, or numbers of a shape: () a float, (k,) a tuple, else an array."""
        return {key: self._numbers(key, w) if isinstance(w, tuple) else self._value(key, w)
                for key, w in wanted.items()}  # fmt: skip

    def section(self, key: str) -> _Section:
        """Return the table under a key."""
        return _Section(self.path, self._value(key, dict), f"{self.where}{key}.")

    def sections(self, key: str) -> list[_Section]:
        """Return the tables of a list of them."""
        tables = self._value(key, list)
        for i, table in enumerate(tables):
            if not isinstance(table, dict):
                raise self.error(f"{key}[{i}]", f"{table!r} is no table")
        return [_Section(self.path, t, f"{self.where}{key}[{i}].") for i, t in enumerate(tables)]

    def _value(self, key: str, kind: type | tuple[type, ...]) -> Any:
        value = self.table.get(key)
        if not isinstance(value, kind) or isinstance(value, bool):  # bool is an int, and no key wants one
            raise self.error(key, "missing" if key not in self.table else f"{self.table[key]!r} is of the wrong kind")
        return self.table[key]

    def _numbers(self, key: str, shape: tuple[int, ...]) -> Any:
        try:
            a = np.asarray(self._value(key, (list, int, float)), float)
        except (TypeError, ValueError) as e:
            raise self.error(key, "holds something that is not a number") from e
        _check(self.path, self.where + key, a, shape)
        return a if a.ndim > 1 else tuple(a.tolist()) if a.ndim else float(a)


@dataclass(frozen=True)
class _Arrays:
    """The arrays of head.npz; every error names the file and the key."""

    path: Path
    stored: dict[str, Array]

    def read(self, key: str, shape: tuple[int, ...]) -> Array:
        """Return the array of a key in the type that omote computes with, whatever it was stored in."""
        if key not in self.stored:
            raise _error(self.path, key, "missing")
        found = _check(self.path, key, self.stored[key], shape)
        with np.errstate(invalid="ignore", over="ignore"):
            array = np.ascontiguousarray(found, TYPES.get(key.rsplit("/", 1)[-1], np.float64))
        lost = not np.isfinite(array).all() or (array.dtype.kind == "i" and (array != found).any())
        if lost:
            raise _error(self.path, key, f"holds numbers that are no {array.dtype}")
        return array

    def split(self, key: str, a: Array, ends: Array) -> list[Array]:
        """Return runs of rows that end at ``ends``, an array kept under ``key``."""
        if len(ends) and (ends[-1] != len(a) or (np.diff(ends) < 0).any() or ends[0] < 0):
            raise _error(self.path, key, f"does not match an array of {len(a)} rows")
        return np.split(a, ends[:-1]) if len(ends) else []


def load_data(path: str | Path) -> HeadData:
    """Read a head from its folder, or from the path of its head.toml.

    Raises HeadFileError: a file is missing, damaged, cut short or of another version; names file and key.
    """
    folder = Path(path)
    folder = folder.parent if folder.name == "head.toml" else folder
    if not folder.is_dir():
        raise HeadFileError(f"{folder}: no such head folder", hint="see configs/heads, or make one: omote fit")
    top, arrays = _read_toml(folder / "head.toml"), _read_npz(folder / "head.npz")
    jaw, parts = top.section("jaw"), top.sections("parts")
    tilts = jaw.section("tilts")
    names = [p.read(name=str)["name"] for p in parts]
    return HeadData(
        **top.read(name=str, paint=list),
        **top.section("pivots").read(eyes=(2, 3), eye_radius=()),
        provenance={k: str(v) for k, v in top.section("provenance").table.items()},
        neck=Neck(**top.section("neck").read(pivot=(3,), slope=(), still=(), whole=())),
        jaw=Jaw(**jaw.read(centre=(3,), angle_rad=(), glide=(3,)),
                tilts=tilts.read(**dict.fromkeys(tilts.table, (3, 4)))),
        parts=[_part(p, arrays) for p in parts],
        seams=[_seam(s, f"seams/{i}", arrays, names) for i, s in enumerate(top.sections("seams"))],
        contacts=[_contact(c, arrays.read(f"contacts/{i}", (2, ANY, ANY, 2)), names)
                  for i, c in enumerate(top.sections("contacts") if "contacts" in top.table else [])],
        rules=[_rule(r) for r in (top.sections("rules") if "rules" in top.table else [])],
        placement=_placement(top.section("placement")) if "placement" in top.table else None,
    )  # fmt: skip


def _read(path: Path, read: Callable[[Path], dict[str, Any]]) -> dict[str, Any]:
    if not path.exists():
        raise _error(path, "file", "missing")
    with files.reading(path, HeadFileError, hint=HINT):
        return read(path)


def _read_toml(path: Path) -> _Section:
    table = _read(path, files.read_toml)
    version = table.get("format")
    if isinstance(version, int) and version > VERSION:
        raise HeadFileError(f"{path}: format: is {version}, this omote reads up to {VERSION}", hint="update omote")
    if version not in (PLAIN, VERSION):
        raise _error(path, "format", f"is {version!r}, this omote reads {PLAIN} and {VERSION}")
    return _Section(path, table)


def _read_npz(path: Path) -> _Arrays:
    return _Arrays(path, _read(path, files.read_npz))


def _part(section: _Section, arrays: _Arrays) -> PartData:
    table = section.read(name=str, material=str, follows=str, budget=(3,), groups=list)
    name, names = table["name"], table.pop("groups")
    cell, chord, depth = table["budget"]
    n = len(arrays.read(f"{name}/points", (ANY, 3)))
    a: dict[str, Any] = {
        k: arrays.read(f"{name}/{k}", tuple(n if x == "n" else int(x) for x in shape)) for k, shape in ARRAYS.items()
    }
    loops = arrays.split(f"{name}/loop_ends", a.pop("loops"), a.pop("loop_ends"))
    all_ids, ends = a.pop("group_ids"), a.pop("group_ends")
    ids, moves = (arrays.split(f"{name}/group_ends", rows, ends) for rows in (all_ids, a.pop("group_moves")))
    if len(names) != len(ids):
        raise section.error("groups", f"{len(names)} names for {len(ids)} groups")
    if len(all_ids) and not 0 <= all_ids.min() <= all_ids.max() < n:
        why = f"points at a control point that is not there (0..{n - 1})"
        raise _error(arrays.path, f"{name}/group_ids", why)
    return PartData(
        **table | {"budget": (int(cell), chord, int(depth))}, **a, loops=loops,
        groups=[Group(str(g), i, m) for g, i, m in zip(names, ids, moves, strict=True)],
        mesh={k: arrays.stored[f"{name}/{k}"] for k in KEYS if f"{name}/{k}" in arrays.stored},
        **_extent(section), cuts=_cuts(arrays, f"{name}/cuts"),
    )  # fmt: skip


def _extent(section: _Section) -> dict[str, Any]:
    """Return which directions of a part are closed, its rectangle and its side; what is not there is left out."""
    shapes: dict[str, tuple[int, ...]] = {"closed_u": (2,), "closed_v": (2,), "rect": (4,)}
    found = section.read(**{key: shape for key, shape in shapes.items() if key in section.table})
    for key, ends in found.items():
        if not all(a < b for a, b in zip(ends[::2], ends[1::2], strict=True)):
            raise section.error(key, f"{list(ends)} does not rise")
    flip = section.table.get("flip", False)
    if not isinstance(flip, bool):
        raise section.error("flip", f"{flip!r} is neither true nor false")
    return found | {"flip": flip}


def _cuts(arrays: _Arrays, key: str) -> tuple[Slit, ...]:
    """Return cuts of a part's mesh: rows of axis (0 along u, 1 along v), at, start, end."""
    if key not in arrays.stored:
        return ()
    rows = arrays.read(key, (ANY, 4))
    try:
        return tuple(Slit("uv"[int(axis)], *map(float, ends)) for axis, *ends in rows)
    except (ValueError, IndexError) as error:
        raise _error(arrays.path, key, f"holds what is no cut ({error})") from error


def _seam(section: _Section, key: str, arrays: _Arrays, names: list[str]) -> Seam:
    a, b = section.read(a=str, b=str).values()
    for part in (a, b):
        if part not in names:
            raise _error(section.path, section.where.rstrip("."), f"no part is named {part!r}")
    uv_a = arrays.read(f"{key}/a", (ANY, 2))
    return Seam(a, b, uv_a, arrays.read(f"{key}/b", (len(uv_a), 2)))


def _contact(section: _Section, places: Floats, names: list[str]) -> Contact:
    t = section.read(name=str, part=str, followers=list, eye=int, reach_mm=(), share=())
    if t["part"] not in names:
        raise section.error("part", f"no part is named {t['part']!r}")
    for follower in t["followers"]:
        if follower not in names[names.index(t["part"]) + 1 :]:
            raise section.error("followers", f"no part named {follower!r} stands after {t['part']!r}")
    if t["eye"] not in (-1, 0, 1):
        raise section.error("eye", f"{t['eye']} is not -1 (lips), 0 (left eye) or 1 (right eye)")
    cling = section.table.get("cling", True)
    if not isinstance(cling, bool):
        raise section.error("cling", f"{cling!r} is neither true nor false")
    seal = _seal(section.section("seal")) if "seal" in section.table else None
    followers = tuple(t.pop("followers"))
    return Contact(**t, followers=followers, places=places.astype(float), cling=cling, seal=seal)


def _seal(section: _Section) -> Seal:
    shares = section.section("opens")
    seal = Seal(opens=shares.read(**dict.fromkeys(shares.table, ())), **section.read(closed=(), parted=()))
    for name in seal.opens:
        if name not in SHAPES:
            raise section.error("opens", f"no shape {name!r}")
    if not seal.closed < seal.parted:
        raise section.error("parted", f"{seal.parted:g} is not greater than closed, {seal.closed:g}")
    return seal


def _rule(section: _Section) -> Rule:
    terms = [term.read(**dict.fromkeys(term.table, ())) for term in section.sections("terms")]
    return Rule(**section.read(group=str, power=()), terms=tuple(terms))


def _placement(section: _Section) -> Placement:
    table = section.read(turn=(3, 3), scale=(), shift=(3,), unit=str)
    turn = table["turn"]
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
        raise section.error("turn", "is no rotation")
    if table["scale"] <= 0:
        raise section.error("scale", f"{table['scale']:g} is not greater than 0")
    return Placement(**table | {"shift": np.array(table["shift"])})


def check_writable(folder: str | Path) -> None:
    """Raise HeadFileError where :func:`save_data` could not write, before a long fit finds out."""
    folder = place = Path(folder)
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        raise HeadFileError(f"{folder}: cannot be written: {place} is no folder", hint="choose another --out folder")
    if not os.access(place, os.W_OK | os.X_OK):
        raise HeadFileError(f"{folder}: {place} may not be written to", hint="choose another --out folder")


def save_data(folder: str | Path, head: HeadData) -> None:
    """Write head.toml and head.npz beside the old ones; when both are written, each replaces its old one as a whole.

    Raises HeadFileError: the folder cannot be written to, or the disk is full; the files that were there are unchanged.
    """
    folder = Path(folder)
    new = folder / "head.npz.new", folder / "head.toml.new"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with new[0].open("wb") as f:
            np.savez_compressed(f, **_arrays(head))  # type: ignore[arg-type]
        new[1].write_text(tomli_w.dumps(_table(head)), encoding="utf-8")
        for path in new:
            path.replace(path.with_suffix(""))
    except OSError as e:
        hint = "choose another folder, or make room on the disk"
        raise HeadFileError(f"{folder}: the head cannot be written ({e})", hint=hint) from e
    finally:  # interrupted ones, too, leave nothing half-written
        for path in new if folder.is_dir() else ():
            path.unlink(missing_ok=True)


def _arrays(head: HeadData) -> dict[str, Array]:
    """Return the content of head.npz."""
    arrays = {f"{p.name}/{k}": v for p in head.parts for k, v in _part_arrays(p).items()}
    for i, s in enumerate(head.seams):
        arrays |= {f"seams/{i}/a": s.uv_a, f"seams/{i}/b": s.uv_b}
    return arrays | {f"contacts/{i}": c.places.astype(np.float32) for i, c in enumerate(head.contacts)}


def _part_arrays(p: PartData) -> dict[str, Array]:
    return {
        **{key: getattr(p, key) for key in ("points", "weights", "knots_u", "knots_v", "jaw", "lids")},
        "degrees": p.degrees.astype(np.int8),
        "slits": p.slits.reshape(-1, 3),
        "loops": np.concatenate([np.zeros((0, 2)), *p.loops]),
        "loop_ends": np.cumsum([len(x) for x in p.loops]).astype(np.int32),
        "group_ids": np.concatenate([np.zeros(0, np.int32), *(g.ids for g in p.groups)]),
        "group_ends": np.cumsum([len(g.ids) for g in p.groups]).astype(np.int32),
        "group_moves": np.concatenate([np.zeros((0, 3), np.float32), *(g.moves for g in p.groups)]),
        **({"cuts": np.array([("uv".index(c.axis), c.at, c.start, c.end) for c in p.cuts])} if p.cuts else {}),
        **p.mesh,
    }


def _table(head: HeadData) -> dict[str, Any]:
    """Return the content of head.toml."""
    return {
        "format": VERSION if any(_extent_table(p) or p.cuts for p in head.parts) else PLAIN,
        "name": head.name,
        "provenance": head.provenance,
        "neck": vars(head.neck),
        "pivots": {"eyes": head.eyes.tolist(), "eye_radius": head.eye_radius},
        "jaw": vars(head.jaw) | {"tilts": {k: np.round(v, 6).tolist() for k, v in head.jaw.tilts.items()}},
        "parts": [
            {"name": p.name, "material": p.material, "follows": p.follows, "budget": p.budget,
             "groups": [g.name for g in p.groups], **_extent_table(p)}
            for p in head.parts
        ],
        "seams": [{"a": s.part_a, "b": s.part_b} for s in head.seams],
        "contacts": [_contact_table(c) for c in head.contacts],
        "rules": [vars(r) for r in head.rules],
        "paint": head.paint,
        **({"placement": head.placement.table()} if head.placement else {}),
    }  # fmt: skip


def _contact_table(contact: Contact) -> dict[str, Any]:
    """Return a contact without its places and what is as usual; its seal, if it has one."""
    usual = ("places", "seal", "cling") if contact.cling else ("places", "seal")
    table = {k: v for k, v in vars(contact).items() if k not in usual}
    return table | ({"seal": vars(contact.seal)} if contact.seal else {})


def _extent_table(part: PartData) -> dict[str, Any]:
    """Return what :func:`_extent` reads, without what is as usual."""
    ends = {key: getattr(part, key) for key in ("closed_u", "closed_v", "rect")}
    table: dict[str, Any] = {key: [float(x) for x in row] for key, row in ends.items() if row is not None}
    return table | ({"flip": True} if part.flip else {})
