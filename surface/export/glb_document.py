"""Heads as glTF documents (glTF 2.0 specification, sections 3 and 4): a node a part, a morph target a shape."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from surface.base.arrays import Array, Floats32
from surface.export.glb_buffers import ARRAY_BUFFER, ELEMENT_BUFFER, FLOAT, UINT, GlbBuffers
from surface.export.shapes import ExportPart
from surface.export.textures import eye_column, materials, png_bytes
from surface.export.worn import CLAMP, LINEAR, MIPMAPS, REPEAT, material_of, sampler_of
from surface.head import Head
from surface.head.model.accessories import Accessory

METRES = np.float32(0.001)
EYE_SAMPLER = {"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": REPEAT, "wrapT": CLAMP}
TEXTURE_SAMPLER = {"magFilter": LINEAR, "minFilter": MIPMAPS, "wrapS": CLAMP, "wrapT": CLAMP}
SPARSE = 0.5  # targets that move less than this share of a part's vertices are kept as sparse accessors


class Document(GlbBuffers):
    """A head as a glTF document and its binary chunk, in metres.

    content : the document, to which more may be added before :meth:`bytes`.
    """

    def __init__(self, head: Head, parts: list[ExportPart], pose: Mapping[str, float],
                 extras: Mapping[str, Any] = MappingProxyType({})) -> None:  # fmt: skip
        super().__init__()
        self._materials: dict[str, dict[str, Any]] = {}
        self._images: list[dict[str, Any]] = []
        self._textures: list[dict[str, Any]] = []
        self._samplers: list[dict[str, int]] = []
        self._pictures: dict[tuple[bytes, int], int] = {}
        amounts = head.own_amounts(head.values(pose)) if head.own_groups else ()
        self._pose = {**pose, **{group.name: float(x) for group, x in zip(head.own_groups, amounts, strict=True)}}
        meshes = [self._mesh(part) for part in parts]
        nodes: list[dict[str, Any]] = [{"name": head.name, "children": list(range(1, len(parts) + 1))}]
        for k, part in enumerate(parts):
            nodes.append({"name": part.name, "mesh": k})
            if part.pivot.any():
                nodes[-1]["translation"] = (METRES * part.pivot).tolist()
        self.content: dict[str, Any] = {
            "asset": asset(head, extras), "scene": 0, "scenes": [{"name": head.name, "nodes": [0]}], "nodes": nodes,
            "meshes": meshes, "materials": list(self._materials.values()), "accessors": self.accessors,
            "bufferViews": self.views,
        }  # fmt: skip
        if self._images:
            self.content |= {"images": self._images, "textures": self._textures, "samplers": self._samplers}

    def _mesh(self, part: ExportPart) -> dict[str, Any]:
        local = METRES * (part.vertices - part.pivot.astype(np.float32))
        attributes = {
            "POSITION": self._floats(local, bounds=True),
            "NORMAL": self._floats(part.normals),
            "TEXCOORD_0": self._floats(np.column_stack([part.uv[:, 0], 1.0 - part.uv[:, 1]])),
        }
        if part.colours is not None:
            attributes["COLOR_0"] = self._floats(part.colours)
        index = part.triangles.astype(np.uint32).ravel()
        indices = self.accessor(index, UINT, "SCALAR", bufferView=self.view(index, ELEMENT_BUFFER))
        primitive: dict[str, Any] = {
            "attributes": attributes, "indices": indices, "material": self._material(part), "mode": 4,
        }  # fmt: skip
        mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
        if part.displacements:
            primitive["targets"] = [
                {
                    "POSITION": self._target(METRES * rows, bounds=True),
                    "NORMAL": self._target(part.normal_changes[name]),
                }
                for name, rows in part.displacements.items()
            ]
            mesh["extras"] = {"targetNames": list(part.displacements)}
            mesh["weights"] = [float(self._pose.get(name, 0.0)) for name in part.displacements]
        return mesh

    def _material(self, part: ExportPart) -> int:
        if part.worn is not None:
            return self._worn_material(part.worn)
        table = materials().get(part.material, materials()["skin"])
        painted = part.colours is not None
        name = f"{part.material}_painted" if painted else part.material
        texture = self._picture_of(part, table)
        name += f"_{texture + 1}" if texture else ""
        if name not in self._materials:
            colour = [1.0, 1.0, 1.0] if painted or part.texture is not None else table["colour"]
            surface: dict[str, Any] = {
                "baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": table["roughness"],
            }  # fmt: skip
            if texture is not None:
                surface["baseColorTexture"] = {"index": texture}
            two_sided = table.get("two_sided", False)
            self._materials[name] = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": two_sided}
        return list(self._materials).index(name)

    def _worn_material(self, worn: Accessory) -> int:
        """Return the index of an accessory's own material."""
        material, key = material_of(worn), f"accessory {worn.name} {len(self._materials)}"
        if worn.texture:
            texture = self._texture(worn.texture, worn.mime, worn.kind, sampler_of(worn))
            material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": texture}
        self._materials[key] = material
        return len(self._materials) - 1

    def _picture_of(self, part: ExportPart, table: Mapping[str, Any]) -> int | None:
        """Return the index of a part's texture: that of its head, or one that is drawn here of an eye; None without."""
        own = part.texture
        if own is not None:
            return self._texture(own.picture, own.mime, part.material, TEXTURE_SAMPLER)
        if "texture" not in table:
            return None
        return self._texture(png_bytes(eye_column(part)), "image/png", "eye", EYE_SAMPLER)

    def _texture(self, picture: bytes, mime: str, name: str, sampler: dict[str, int]) -> int:
        """Return the index of a texture; the same one is kept once."""
        if sampler not in self._samplers:
            self._samplers.append(sampler)
        key = picture, self._samplers.index(sampler)
        if key not in self._pictures:
            self._pictures[key] = len(self._textures)
            view = self.view(np.frombuffer(picture, np.uint8))
            self._images.append({"name": name, "mimeType": mime, "bufferView": view})
            self._textures.append({"source": len(self._images) - 1, "sampler": key[1]})
        return self._pictures[key]

    def _target(self, rows: Floats32, *, bounds: bool = False) -> int:
        """Return an accessor of displacements, sparse where most of them are zero."""
        ids = np.flatnonzero(rows.any(axis=1))
        if not 0 < len(ids) < SPARSE * len(rows):
            return self._floats(rows, bounds=bounds)
        indices = {"bufferView": self.view(ids.astype(np.uint32)), "componentType": UINT}
        sparse = {"count": len(ids), "indices": indices, "values": {"bufferView": self.view(rows[ids])}}
        return self.accessor(rows, FLOAT, "VEC3", bounds=bounds, sparse=sparse)

    def _floats(self, rows: Array, *, bounds: bool = False) -> int:
        rows = np.ascontiguousarray(rows, np.float32)
        return self.accessor(
            rows, FLOAT, f"VEC{rows.shape[1]}", bounds=bounds, bufferView=self.view(rows, ARRAY_BUFFER)
        )


def asset(head: Head, extras: Mapping[str, Any]) -> dict[str, Any]:
    provenance = {k: str(v) for k, v in head.data.provenance.items()}
    source = "; ".join(v for k, v in provenance.items() if k in ("source_name", "source_licence"))
    out: dict[str, Any] = {"version": "2.0", "generator": "omote", "extras": {**provenance, **extras}}
    return out | ({"copyright": source} if source else {})
