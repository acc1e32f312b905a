"""Reading and writing ``head.toml`` (what a user may edit) and ``head.npz`` (control points and groups)."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any
from zipfile import BadZipFile
from zlib import error as ZlibError

import numpy as np

from surface.base.arrays import Array, Floats
from surface.base.errors import HeadFileError
from surface.head.model.data import Contact, Group, HeadData, Jaw, Neck, PartData, Rule, Seam
from surface.head.model.meshes import KEYS
from surface.head.model.tomltext import toml_text

VERSION = 1
ARRAYS = {  # key of a part: columns (0 = one-dimensional)
    "points": 3, "weights": 0, "knots_u": -1, "knots_v": -1, "degrees": 2, "loops": 2, "loop_ends": 0,
    "slits": 3, "group_ids": 0, "group_ends": 0, "group_moves": 3, "jaw": 0, "lids": 0,
}  # fmt: skip
PER_POINT = ("weights", "knots_u", "knots_v", "degrees", "jaw", "lids")


class Source:
    """Checked access to the two files: every failure names file and key."""

    def __init__(self, folder: Path) -> None:
        self.toml_path, self.npz_path = folder / "head.toml", folder / "head.npz"
        if not folder.is_dir():
            raise HeadFileError(f"{folder}: no such head folder", hint="see configs/heads, or make one: omote fit")
        self.table = self._toml()
        self.arrays = self._npz()

    def bad(self, path: Path, key: str, why: str) -> HeadFileError:
        """The error for a key of one of the files."""
        return HeadFileError(f"{path}: {key}: {why}", hint="restore the file or make the head again: omote fit")

    def _toml(self) -> dict[str, Any]:
        try:
            table = tomllib.loads(self.toml_path.read_text(encoding="utf-8"))
        except FileNotFoundError as e:
            raise self.bad(self.toml_path, "file", "missing") from e
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as e:
            raise self.bad(self.toml_path, "file", f"cannot be read ({e})") from e
        version = table.get("format")
        if isinstance(version, int) and version > VERSION:
            why = f"is {version}, this omote reads up to {VERSION}"
            raise HeadFileError(f"{self.toml_path}: format: {why}", hint="update omote")
        if version != VERSION:
            raise self.bad(self.toml_path, "format", f"is {version!r}, this omote reads {VERSION}")
        return table

    def _npz(self) -> dict[str, Array]:
        try:
            with self.npz_path.open("rb") as f, np.load(f, allow_pickle=False) as z:
                return {k: z[k] for k in z.files}
        except FileNotFoundError as e:
            raise self.bad(self.npz_path, "file", "missing") from e
        except (OSError, ValueError, EOFError, BadZipFile, ZlibError, KeyError) as e:
            raise self.bad(self.npz_path, "file", f"damaged or cut short ({e})") from e

    def value(self, table: dict[str, Any], key: str, kind: type | tuple[type, ...], where: str = "") -> Any:
        """``table[key]``, which must be of the kind."""
        if not isinstance(table.get(key), kind):
            why = "missing" if key not in table else f"{table[key]!r} is of the wrong kind"
            raise self.bad(self.toml_path, f"{where}{key}", why)
        return table[key]

    def numbers(self, table: dict[str, Any], key: str, shape: tuple[int, ...], where: str = "") -> Floats:
        """A list of finite numbers of the given shape (-1: any length)."""
        raw = self.value(table, key, (list, int, float), where)
        try:
            a = np.asarray(raw, float)
        except (TypeError, ValueError) as e:
            raise self.bad(self.toml_path, f"{where}{key}", "holds something that is not a number") from e
        return self._checked(self.toml_path, f"{where}{key}", a, shape)

    def array(self, key: str, shape: tuple[int, ...]) -> Array:
        """An array of head.npz of the given shape (-1: any length)."""
        if key not in self.arrays:
            raise self.bad(self.npz_path, key, "missing")
        return self._checked(self.npz_path, key, self.arrays[key], shape)

    def _checked(self, path: Path, key: str, a: Array, shape: tuple[int, ...]) -> Array:
        if a.ndim != len(shape) or any(w not in (-1, g) for g, w in zip(a.shape, shape, strict=True)):
            raise self.bad(path, key, f"has shape {a.shape}, expected {shape}".replace("-1", "any"))
        if a.dtype.kind not in "fiu" or not np.isfinite(a).all():
            raise self.bad(path, key, "holds something that is not a finite number")
        return a


def load_data(path: str | Path) -> HeadData:
    """Read a head from its folder, or from the path of its head.toml.

    Raises
    ------
    HeadFileError : a file is missing, damaged, cut short or of another version; names file and key.
    """
    folder = Path(path)
    src = Source(folder.parent if folder.name == "head.toml" else folder)
    t = src.table
    pivots = src.value(t, "pivots", dict)
    names = [src.value(p, "name", str, f"parts[{i}].") for i, p in enumerate(src.value(t, "parts", list))]
    return HeadData(
        name=src.value(t, "name", str),
        provenance={k: str(v) for k, v in src.value(t, "provenance", dict).items()},
        neck=_neck(src, src.value(t, "neck", dict)),
        eyes=src.numbers(pivots, "eyes", (2, 3), "pivots."),
        eye_radius=float(src.numbers(pivots, "eye_radius", (), "pivots.")),
        jaw=_jaw(src, src.value(t, "jaw", dict)),
        parts=[_part(src, p, f"parts[{i}].") for i, p in enumerate(t["parts"])],
        seams=[_seam(src, s, i, names) for i, s in enumerate(src.value(t, "seams", list))],
        paint=src.value(t, "paint", list),
        contacts=[_contact(src, c, i, names) for i, c in enumerate(t.get("contacts", []))],
        rules=[_rule(src, r, i) for i, r in enumerate(t.get("rules", []))],
    )


def _neck(src: Source, t: dict[str, Any]) -> Neck:
    slope, still, whole = (float(src.numbers(t, k, (), "neck.")) for k in ("slope", "still", "whole"))
    return Neck(tuple(src.numbers(t, "pivot", (3,), "neck.").tolist()), slope, still, whole)


def _jaw(src: Source, t: dict[str, Any]) -> Jaw:
    tilts = src.value(t, "tilts", dict, "jaw.")
    return Jaw(
        tuple(src.numbers(t, "centre", (3,), "jaw.").tolist()),
        float(src.numbers(t, "angle_rad", (), "jaw.")),
        tuple(src.numbers(t, "glide", (3,), "jaw.").tolist()),
        {k: src.numbers(tilts, k, (3, 4), "jaw.tilts.") for k in tilts},
    )


def _part(src: Source, t: dict[str, Any], where: str) -> PartData:
    name = t["name"]
    n = len(src.array(f"{name}/points", (-1, 3)))
    shapes = {k: (-1,) if c == 0 else (-1, c) for k, c in ARRAYS.items()}
    shapes |= {k: (n, *shapes[k][1:]) for k in PER_POINT}
    a = {k: src.array(f"{name}/{k}", shape) for k, shape in shapes.items()}
    return PartData(
        name, src.value(t, "material", str, where), src.value(t, "follows", str, where),
        a["points"], a["weights"], a["knots_u"], a["knots_v"], a["degrees"],
        _split(src, f"{name}/loop_ends", a["loops"], a["loop_ends"]), a["slits"],
        _budget(src, t, where), _groups(src, t, name, n, a, where),
        a["jaw"], a["lids"],
        {k: src.arrays[f"{name}/{k}"] for k in KEYS if f"{name}/{k}" in src.arrays},
    )  # fmt: skip


def _budget(src: Source, t: dict[str, Any], where: str) -> tuple[int, float, int]:
    cell, chord, depth = src.numbers(t, "budget", (3,), where).tolist()
    return int(cell), chord, int(depth)


def _groups(src: Source, t: dict[str, Any], name: str, n: int, a: dict[str, Array], where: str) -> list[Group]:
    names = src.value(t, "groups", list, where)
    ids = _split(src, f"{name}/group_ends", a["group_ids"], a["group_ends"])
    moves = _split(src, f"{name}/group_ends", a["group_moves"], a["group_ends"])
    if len(names) != len(ids):
        raise src.bad(src.toml_path, f"{where}groups", f"{len(names)} names for {len(ids)} groups")
    if len(a["group_ids"]) and not 0 <= a["group_ids"].min() <= a["group_ids"].max() < n:
        raise src.bad(src.npz_path, f"{name}/group_ids", f"points at a control point that is not there (0..{n - 1})")
    return [Group(str(g), i, m) for g, i, m in zip(names, ids, moves, strict=True)]


def _split(src: Source, key: str, a: Array, ends: Array) -> list[Array]:
    if len(ends) and (ends[-1] != len(a) or (np.diff(ends) < 0).any() or ends[0] < 0):
        raise src.bad(src.npz_path, key, f"does not match an array of {len(a)} rows")
    return np.split(a, ends[:-1]) if len(ends) else []


def _seam(src: Source, t: dict[str, Any], i: int, names: list[str]) -> Seam:
    parts = [src.value(t, k, str, f"seams[{i}].") for k in ("a", "b")]
    for p in parts:
        if p not in names:
            raise src.bad(src.toml_path, f"seams[{i}]", f"no part is named {p!r}")
    uv_a = src.array(f"seams/{i}/a", (-1, 2))
    return Seam(parts[0], parts[1], uv_a, src.array(f"seams/{i}/b", (len(uv_a), 2)))


def _contact(src: Source, t: dict[str, Any], i: int, names: list[str]) -> Contact:
    where = f"contacts[{i}]."
    reach, share = (float(src.numbers(t, k, (), where)) for k in ("reach_mm", "share"))
    name, part, eye = (
        src.value(t, "name", str, where),
        src.value(t, "part", str, where),
        src.value(t, "eye", int, where),
    )
    followers = src.value(t, "followers", list, where)
    if part not in names:
        raise src.bad(src.toml_path, f"{where}part", f"no part is named {part!r}")
    for follower in followers:
        if follower not in names[names.index(part) + 1 :]:
            raise src.bad(src.toml_path, f"{where}followers", f"no part named {follower!r} stands after {part!r}")
    if eye not in (-1, 0, 1):
        raise src.bad(src.toml_path, f"{where}eye", f"{eye} is not -1 (lips), 0 (left eye) or 1 (right eye)")
    places = src.array(f"contacts/{i}", (2, -1, -1, 2)).astype(float)
    return Contact(name, part, tuple(followers), eye, reach, share, places)


def _rule(src: Source, t: dict[str, Any], i: int) -> Rule:
    where = f"rules[{i}]."
    terms = src.value(t, "terms", list, where)
    for k, term in enumerate(terms):
        for name in term:
            src.numbers(term, name, (), f"{where}terms[{k}].")
    return Rule(src.value(t, "group", str, where), tuple(terms), float(src.numbers(t, "power", (), where)))


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
    """Write head.toml and head.npz; either both are replaced or none is.

    Raises
    ------
    HeadFileError : the folder cannot be written to, or the disk is full; what stood there stands as before.
    """
    folder = Path(folder)
    new = folder / "head.npz.new", folder / "head.toml.new"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with new[0].open("wb") as f:
            np.savez_compressed(f, **_arrays(head))  # type: ignore[arg-type]
        new[1].write_text(toml_text(_table(head)), encoding="utf-8")
        for path in new:
            path.replace(path.with_suffix(""))
    except OSError as e:
        hint = "choose another folder, or make room on the disk"
        raise HeadFileError(f"{folder}: the head cannot be written ({e})", hint=hint) from e
    finally:  # interrupted ones, too, leave nothing half-written
        for path in new if folder.is_dir() else ():
            path.unlink(missing_ok=True)


def _arrays(head: HeadData) -> dict[str, Array]:
    """Everything that goes into head.npz."""
    arrays: dict[str, Array] = {}
    for p in head.parts:
        arrays |= {f"{p.name}/{k}": v for k, v in _part_arrays(p).items()}
    for i, s in enumerate(head.seams):
        arrays |= {f"seams/{i}/a": s.uv_a, f"seams/{i}/b": s.uv_b}
    return arrays | {f"contacts/{i}": c.places.astype(np.float32) for i, c in enumerate(head.contacts)}


def _part_arrays(p: PartData) -> dict[str, Array]:
    return {
        "points": p.points, "weights": p.weights, "knots_u": p.knots_u, "knots_v": p.knots_v,
        "degrees": p.degrees.astype(np.int8),
        "loops": np.concatenate(p.loops) if p.loops else np.zeros((0, 2)),
        "loop_ends": np.cumsum([len(x) for x in p.loops]).astype(np.int32),
        "slits": p.slits.reshape(-1, 3),
        "group_ids": np.concatenate([g.ids for g in p.groups]) if p.groups else np.zeros(0, np.int32),
        "group_ends": np.cumsum([len(g.ids) for g in p.groups]).astype(np.int32),
        "group_moves": np.concatenate([g.moves for g in p.groups]) if p.groups else np.zeros((0, 3), np.float32),
        "jaw": p.jaw, "lids": p.lids, **p.mesh,
    }  # fmt: skip


def _table(head: HeadData) -> dict[str, Any]:
    return {
        "format": VERSION,
        "name": head.name,
        "provenance": head.provenance,
        "neck": {**vars(head.neck), "pivot": list(head.neck.pivot)},
        "pivots": {"eyes": head.eyes.tolist(), "eye_radius": head.eye_radius},
        "jaw": {
            "centre": list(head.jaw.centre),
            "angle_rad": head.jaw.angle_rad,
            "glide": list(head.jaw.glide),
            "tilts": {k: np.round(v, 6).tolist() for k, v in head.jaw.tilts.items()},
        },
        "parts": [
            {"name": p.name, "material": p.material, "follows": p.follows, "budget": list(p.budget),
             "groups": [g.name for g in p.groups]}
            for p in head.parts
        ],
        "seams": [{"a": s.part_a, "b": s.part_b} for s in head.seams],
        "contacts": [
            {**{k: v for k, v in vars(c).items() if k != "places"}, "followers": list(c.followers)}
            for c in head.contacts
        ],
        "rules": [{**vars(r), "terms": list(r.terms)} for r in head.rules],
        "paint": head.paint,
    }  # fmt: skip
