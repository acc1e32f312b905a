"""Names of morph targets, and expressions that avatars in the VRM format make of them.

VRM 0 keeps expressions in ``extensions.VRM.blendShapeMaster``, VRM 1 in ``extensions.VRMC_vrm.expressions``. What is
damaged in them is left out: the mesh is whole without.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from itertools import count as count_from
from typing import Any

from surface.readers.gltf import Gltf
from surface.readers.meshdata import Expression

PERCENT = 0.01  # VRM 0 gives weights in percent


def target_names(file: Gltf, index: int, count: int) -> list[str]:
    """Names of the morph targets of a mesh, at least ``count``: what the file calls them, or their numbers.

    No two are equal: a name that occurs again is numbered.
    """
    mesh = _table(file.items("meshes")[index])
    found = _named(mesh) or next((n for p in _list(mesh.get("primitives")) if (n := _named(_table(p)))), [])
    prefix = f"mesh{index}_" if _unnamed(file) > 1 else ""
    every = found + [f"{prefix}target{k}" for k in range(len(found), count)]
    seen: set[str] = set()
    for k, name in enumerate(every):
        numbered = (f"{name} ({n})" for n in count_from(2))
        every[k] = next(n for n in chain([name], numbered) if n not in seen)
        seen.add(every[k])
    return every


def _named(table: dict[str, Any]) -> list[str]:
    return [str(n) for n in _list(_table(table.get("extras")).get("targetNames"))]


def _unnamed(file: Gltf) -> int:
    """How many meshes have targets without names: two of them must not be taken for one another."""
    out = 0
    for mesh in file.items("meshes"):
        primitives = [_table(p) for p in _list(_table(mesh).get("primitives"))]
        named = _named(_table(mesh)) or any(_named(p) for p in primitives)
        out += not named and any(p.get("targets") for p in primitives)
    return out


def read_expressions(file: Gltf) -> tuple[Expression, ...]:
    """Every expression of a VRM file that moves something; presets go by the names of the specification."""
    return tuple(e for e in (*_of_vrm_0(file), *_of_vrm_1(file)) if e.binds)


def _of_vrm_0(file: Gltf) -> Iterator[Expression]:
    master = _table(_extension(file, "VRM").get("blendShapeMaster"))
    for group in map(_table, _list(master.get("blendShapeGroups"))):
        preset = _text(group.get("presetName")).lower()
        name = _text(group.get("name")) if preset in ("", "unknown") else preset
        binds = [
            (b.get("mesh"), b.get("index"), _number(b.get("weight")) * PERCENT)
            for b in map(_table, _list(group.get("binds")))
        ]
        yield Expression(name, _shapes(file, binds))


def _of_vrm_1(file: Gltf) -> Iterator[Expression]:
    expressions, nodes = _table(_extension(file, "VRMC_vrm").get("expressions")), file.items("nodes")
    for group in ("preset", "custom"):
        for name, table in _table(expressions.get(group)).items():
            binds = []
            for bind in map(_table, _list(_table(table).get("morphTargetBinds"))):
                node = bind.get("node")
                mesh = _table(nodes[node]).get("mesh") if isinstance(node, int) and 0 <= node < len(nodes) else None
                binds.append((mesh, bind.get("index"), _number(bind.get("weight"))))
            yield Expression(str(name), _shapes(file, binds))


def _shapes(file: Gltf, binds: list[tuple[Any, Any, float]]) -> tuple[tuple[str, float], ...]:
    """Names of shapes and weights of (mesh, target, weight); a shape that several meshes share counts once."""
    out: dict[str, float] = {}
    for mesh, index, weight in binds:
        if isinstance(mesh, int) and isinstance(index, int) and 0 <= mesh < len(file.items("meshes")):
            names = target_names(file, mesh, index + 1) if 0 <= index < 10_000 else []
            if names and weight:
                out[names[index]] = max(out.get(names[index], 0.0), weight, key=abs)
    return tuple(out.items())


def _extension(file: Gltf, name: str) -> dict[str, Any]:
    return _table(_table(file.document.get("extensions")).get(name))


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""


def _number(value: Any) -> float:
    good = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e3
    return float(value) if good else 0.0
