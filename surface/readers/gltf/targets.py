"""Names of morph targets, and expressions that avatars in the VRM format make of them.

VRM 0 keeps expressions in ``extensions.VRM.blendShapeMaster``, VRM 1 in ``extensions.VRMC_vrm.expressions``. What is
damaged in them is left out: the mesh is whole without.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from surface.readers.gltf.container import Gltf
from surface.readers.meshdata import Expression

PERCENT = 0.01  # VRM 0 gives weights in percent


class TargetNames:
    """Names of the morph targets of a file's meshes: what the file calls them, or their numbers.

    No two of a mesh are equal: a name that occurs again is numbered. The names of a mesh are made once.
    """

    def __init__(self, file: Gltf) -> None:
        self._meshes = file.items("meshes")
        self._several = _count_unnamed(self._meshes) > 1
        self._made: dict[int, list[str]] = {}

    def of(self, index: int) -> list[str]:
        """Return the names of a mesh's targets, as many as any primitive has targets, or more if the file names
        more.
        """
        if index not in self._made:
            mesh = _table(self._meshes[index])
            primitives = [_table(p) for p in _list(mesh.get("primitives"))]
            found = _target_names(mesh) or next((n for p in primitives if (n := _target_names(p))), [])
            count = max((len(_list(p.get("targets"))) for p in primitives), default=0)
            prefix = f"mesh{index}_" if self._several else ""
            self._made[index] = _number_duplicates([*found, *(f"{prefix}target{k}" for k in range(len(found), count))])
        return self._made[index]

    def __len__(self) -> int:
        return len(self._meshes)


def _number_duplicates(names: list[str]) -> list[str]:
    """Return the names, with a number behind each that occurred before."""
    seen, numbers, out = set[str](), dict[str, int](), list[str]()
    for name in names:
        unique, number = name, numbers.get(name, 2)
        while unique in seen:
            unique, number = f"{name} ({number})", number + 1
        numbers[name] = number
        seen.add(unique)
        out.append(unique)
    return out


def _target_names(table: dict[str, Any]) -> list[str]:
    return [str(n) for n in _list(_table(table.get("extras")).get("targetNames"))]


def _count_unnamed(meshes: list[Any]) -> int:
    """Return how many meshes have targets without names: two of them must not be taken for one another."""
    out = 0
    for mesh in meshes:
        primitives = [_table(p) for p in _list(_table(mesh).get("primitives"))]
        named = _target_names(_table(mesh)) or any(_target_names(p) for p in primitives)
        out += not named and any(p.get("targets") for p in primitives)
    return out


def read_expressions(file: Gltf, names: TargetNames) -> tuple[Expression, ...]:
    """Return every expression of a VRM file that moves something; presets go by the names of the specification."""
    return tuple(e for e in (*_of_vrm_0(file, names), *_of_vrm_1(file, names)) if e.binds)


def _of_vrm_0(file: Gltf, names: TargetNames) -> Iterator[Expression]:
    master = _table(_extension(file, "VRM").get("blendShapeMaster"))
    for group in map(_table, _list(master.get("blendShapeGroups"))):
        preset = _text(group.get("presetName")).lower()
        name = _text(group.get("name")) if preset in ("", "unknown") else preset
        binds = [
            (b.get("mesh"), b.get("index"), _number(b.get("weight")) * PERCENT)
            for b in map(_table, _list(group.get("binds")))
        ]
        yield Expression(name, _shapes(names, binds))


def _of_vrm_1(file: Gltf, names: TargetNames) -> Iterator[Expression]:
    expressions, nodes = _table(_extension(file, "VRMC_vrm").get("expressions")), file.items("nodes")
    for group in ("preset", "custom"):
        for name, table in _table(expressions.get(group)).items():
            binds = []
            for bind in map(_table, _list(_table(table).get("morphTargetBinds"))):
                node = bind.get("node")
                mesh = _table(nodes[node]).get("mesh") if isinstance(node, int) and 0 <= node < len(nodes) else None
                binds.append((mesh, bind.get("index"), _number(bind.get("weight"))))
            yield Expression(str(name), _shapes(names, binds))


def _shapes(names: TargetNames, binds: list[tuple[Any, Any, float]]) -> tuple[tuple[str, float], ...]:
    """Return names of shapes and weights of (mesh, target, weight); a shape that several meshes share counts once."""
    out: dict[str, float] = {}
    for mesh, index, weight in binds:
        if isinstance(mesh, int) and isinstance(index, int) and 0 <= mesh < len(names):
            found = names.of(mesh)
            if 0 <= index < len(found) and weight:
                out[found[index]] = max(out.get(found[index], 0.0), weight, key=abs)
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
