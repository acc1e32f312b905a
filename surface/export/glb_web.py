"""Heads as small glTF documents for pages of browsers: quantized (extension KHR_mesh_quantization), sparse, with a neck
that bends and eyes that turn.

All parts but the eyeballs are bound to two joints, ``body`` and ``head``; eyeballs are nodes below ``head`` about their
own centres. Positions are whole steps, which the inverse bind matrices (of an eyeball its node) turn into metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from surface.base.arrays import Array, Floats, Floats32
from surface.export.glb_buffers import (
    ARRAY_BUFFER,
    BYTE,
    ELEMENT_BUFFER,
    FLOAT,
    SHORT,
    UBYTE,
    UINT,
    USHORT,
    GlbBuffers,
)
from surface.export.glb_document import asset
from surface.export.shapes import shapes_of
from surface.export.textures import (
    STRAND_CUTOFF,
    Picture,
    eye_picture,
    materials,
    picture_radii,
    png_bytes,
    strand_picture,
    strip_picture,
)
from surface.export.web_parts import BREATH, BREATH_MM, HALF, HALVES, WebPart, web_parts, worn_web_parts
from surface.export.worn import material_of, web_texture, wrap_of
from surface.head import Head
from surface.head.model.accessories import Accessory

METRES = 0.001
_FORMAT = 1
"""Version of what ``extras.omote`` of the document holds."""
_CLOSED_MM = 1.2  # lips that are nowhere further apart than this at rest are closed
_LIP_COLUMNS, _PARTED_MM = 7, 0.3  # where lips are measured; a shape that moves them apart by less does not count
_MAX_STEPS = 32_700  # steps from the middle of the head
_COARSE_MM, _COARSE_NORMAL = 0.03, 8  # moves are whole multiples of these: mm, and steps of a 16-bit normal
_FADES = {"brow": ((0.72, 0.50, 0.30, 2.4), True), "lash": ((0.85, 0.15, 0.0, 0.0), False)}
_HAIR = ("strand", "tress")
_LINEAR, _MIPMAPS, _REPEAT, _CLAMP = 9729, 9987, 10497, 33071


def lips_open_at_rest(head: Head) -> bool:
    """Whether one sees into the mouth of a head at rest: its lips are apart, or it has none that are known to meet."""
    for contact in head.contacts:
        if contact.eye < 0:
            surface, columns = head.part(contact.part).surface, contact.places.swapaxes(0, 1)
            return any(_nearest_mm(*(surface.evaluate(side) for side in column)) > _CLOSED_MM for column in columns)
    return True


def _nearest_mm(one: Floats, other: Floats) -> float:
    """The least distance between two rows of points (n, 3), (m, 3)."""
    return float(np.linalg.norm(one[:, None] - other, axis=2).min())


def lip_gaps(head: Head) -> dict[str, list[float]]:
    """Return how far each shape, the user's own groups among them, parts the lips.

    By shape: mm of height in each of some columns from one corner of the mouth to the other, at weight 1, negative
    where it closes what another shape opens. ``-NAME`` is that of an own group at weight -1. Shapes that part no lips
    are left out.
    """
    lips = next((contact for contact in head.contacts if contact.eye < 0), None)
    if lips is None:
        return {}
    part, columns = head.part(lips.part), lips.places[:, :: max(1, lips.places.shape[1] // _LIP_COLUMNS)]
    rows = [[part.surface.basis_rows(side) for side in column] for column in columns.swapaxes(0, 1)]

    def gaps(pose: Mapping[str, float]) -> Floats:
        head.pose(head.values(pose))
        points = part.control_points
        return np.array([(up @ points)[:, 1].min() - (low @ points)[:, 1].max() for up, low in rows])

    found: dict[str, list[float]] = {}
    own = {group.name for group in head.own_groups}
    for name, base in shapes_of(head).items():
        before = gaps(base)
        for key, amount in ((name, 1.0), (f"-{name}", -1.0))[: 2 if name in own else 1]:
            mm = gaps({**base, name: amount}) - before
            if np.abs(mm).max() > _PARTED_MM:
                found[key] = [round(float(x), 2) for x in mm]
    head.pose(head.values({}))
    return found


def web_glb(head: Head) -> bytes:
    """Return a head as a small .glb (glTF 2.0 with KHR_mesh_quantization), of which gzip takes away another half."""
    return _WebDocument(head, web_parts(head) + worn_web_parts(head)).bytes()


class _WebDocument(GlbBuffers):
    """A head while it is written."""

    def __init__(self, head: Head, parts: list[WebPart]) -> None:
        super().__init__()
        self._materials: list[dict[str, Any]] = []
        self._textures: list[dict[str, Any]] = []
        self._images: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._known: dict[tuple[str, bytes], int] = {}
        bound = [one for one in parts if not one.part.pivot.any()]
        self._middle, self._step_mm = _grid([one.part.vertices for one in bound])
        self._neck = head.data.neck
        self._lips_open, self._lips = lips_open_at_rest(head), lip_gaps(head)
        self._own = {group.name: list(group.times) for group in head.own_groups}
        drawn = [one.part for one in parts if one.part.material == "eye" and one.part.texture is None]
        self._eyes = {part.name: [round(radius, 5) for radius in picture_radii(part)] for part in drawn}
        self._nodes: list[dict[str, Any]] = []
        self._roots = [0]  # and every part that is bound to joints: what is above it would not move it
        self._meshes: list[dict[str, Any]] = []
        self._add_nodes(head, parts)
        self.content = {
            "asset": asset(head, {}), "scene": 0, "scenes": [{"name": head.name, "nodes": self._roots}],
            "nodes": self._nodes, "meshes": self._meshes, "materials": self._materials, "accessors": self.accessors,
            "bufferViews": self.views, "extensionsUsed": ["KHR_mesh_quantization"],
            "extensionsRequired": ["KHR_mesh_quantization"], "extras": {"omote": self._extras()},
        }  # fmt: skip
        if bound:
            self.content["skins"] = [self._skin(1, 2)]
        if self._images:
            self.content |= {"images": self._images, "textures": self._textures, "samplers": self._samplers}

    def _extras(self) -> dict[str, Any]:
        neck = self._neck
        names = {name for mesh in self._meshes for name in mesh.get("extras", {}).get("targetNames", [])}
        return {
            "format": _FORMAT, "half": sorted(names & {name + HALF for name in HALVES}), "own": self._own,
            "lips_open": self._lips_open, "lips": self._lips,
            "breath": {BREATH: BREATH_MM} if BREATH in names else {}, "eyes": self._eyes,
            "neck": {"pivot": (METRES * np.array(neck.pivot)).tolist()},
        }  # fmt: skip

    def _add_nodes(self, head: Head, parts: list[WebPart]) -> None:
        pivot = METRES * np.array(self._neck.pivot)
        self._nodes += [{"name": head.name, "children": [1, 2]}, {"name": "body"}]
        self._nodes.append({"name": "head", "translation": pivot.tolist(), "children": list[int]()})
        for one in parts:
            part, node = one.part, {"name": one.part.name, "mesh": len(self._meshes)}
            self._nodes.append(node)
            if part.pivot.any():
                middle, step_mm = part.pivot, _grid([part.vertices], part.pivot)[1]
                node |= {"translation": (METRES * part.pivot - pivot).tolist(), "scale": [METRES * step_mm] * 3}
                self._nodes[2]["children"].append(len(self._nodes) - 1)
            else:
                middle, step_mm = self._middle, self._step_mm
                node["skin"] = 0
                self._roots.append(len(self._nodes) - 1)
            self._meshes.append(self._mesh(one, middle, step_mm))
        if not self._nodes[2]["children"]:
            del self._nodes[2]["children"]

    def _mesh(self, one: WebPart, middle: Floats, step_mm: float) -> dict[str, Any]:
        part = one.part
        steps = np.rint((part.vertices - middle) / step_mm).astype(np.int16)
        attributes = {
            "POSITION": self._vertices(steps, SHORT, bounds=True),
            "NORMAL": self._vertices(_normal_steps(part.normals), SHORT, normalized=True),
            "COLOR_0": self._vertices(_colour_steps(one.colours), USHORT, normalized=True),
        }
        if one.uv is not None:
            attributes["TEXCOORD_0"] = self._vertices(one.uv.astype(np.float32), FLOAT)
        for name, rows in one.baked.items():
            attributes[name] = self._vertices(rows, UBYTE, normalized=True)
        if not part.pivot.any():
            attributes |= self._binding(self._neck.share(part.vertices.astype(float)))
        primitive = {"attributes": attributes, "indices": self._triangles(part.triangles, len(steps)),
                     "material": self._material(one), "mode": 4}  # fmt: skip
        mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
        if part.displacements:
            primitive["targets"] = [
                self._target(rows / step_mm, part.normal_changes[name], max(1, round(_COARSE_MM / step_mm)))
                for name, rows in part.displacements.items()
            ]
            mesh |= {"extras": {"targetNames": list(part.displacements)}, "weights": [0.0] * len(part.displacements)}
        return mesh

    def _triangles(self, triangles: Array, count: int) -> int:
        wide = count > 65_535
        index = triangles.astype(np.uint32 if wide else np.uint16).ravel()
        return self.accessor(index, UINT if wide else USHORT, "SCALAR", bufferView=self.view(index, ELEMENT_BUFFER))

    def _vertices(self, rows: Array, component: int, *, bounds: bool = False, **more: Any) -> int:
        """Return an accessor of a vertex attribute (m, k), each row padded to whole words of four bytes."""
        size = rows.shape[1] * rows.itemsize
        stride = size + -size % 4
        padded = np.zeros((len(rows), stride // rows.itemsize), rows.dtype)
        padded[:, : rows.shape[1]] = rows
        view = self.view(padded, ARRAY_BUFFER, byteStride=stride)
        return self.accessor(rows, component, f"VEC{rows.shape[1]}", bounds=bounds, bufferView=view, **more)

    def _binding(self, share: Floats) -> dict[str, int]:
        """Return joints and weights by the share (m,) of the head's rotation that each vertex follows."""
        weights, joints = np.zeros((len(share), 4), np.uint8), np.zeros((len(share), 4), np.uint8)
        weights[:, 0] = np.rint(255.0 * share)
        weights[:, 1] = 255 - weights[:, 0]
        joints[:, 0] = weights[:, 0] > 0  # an unused joint must be 0
        still = weights[:, 0] == 0
        weights[still, :2] = 255, 0
        return {"JOINTS_0": self._vertices(joints, UBYTE), "WEIGHTS_0": self._vertices(weights, UBYTE, normalized=True)}

    def _target(self, moves: Floats | Floats32, turns: Floats32, coarse: int) -> dict[str, int]:
        """Return a morph target of moves (m, 3) in steps and changes of normals (m, 3), sparse over the same
        vertices.
        """
        steps = (coarse * np.rint(moves / coarse)).astype(np.int16)
        bent = np.rint(np.clip(turns, -1.0, 1.0) * 127.0).astype(np.int8)
        ids = np.flatnonzero(steps.any(axis=1) | bent.any(axis=1))
        if not len(ids):
            ids = np.zeros(1, np.int64)
        wide = len(steps) > 65_535
        index = {"bufferView": self.view(ids.astype(np.uint32 if wide else np.uint16)),
                 "componentType": UINT if wide else USHORT}  # fmt: skip
        return {
            "POSITION": self._sparse(steps, ids, index, SHORT, bounds=True),
            "NORMAL": self._sparse(bent, ids, index, BYTE, normalized=True),
        }

    def _sparse(self, rows: Array, ids: Array, index: dict[str, int], component: int, **more: Any) -> int:
        values = {"bufferView": self.view(np.ascontiguousarray(rows[ids]))}
        return self.accessor(
            rows, component, "VEC3", sparse={"count": len(ids), "indices": index, "values": values}, **more
        )

    def _skin(self, still: int, turning: int) -> dict[str, Any]:
        """Return the two joints; their inverse bind matrices take steps to metres about each joint."""
        bind = np.zeros((2, 4, 4), np.float32)
        bind[:, [0, 1, 2], [0, 1, 2]], bind[:, 3, 3] = METRES * self._step_mm, 1.0
        bind[:, 3, :3] = METRES * self._middle  # column-major: the translation is the last row
        bind[1, 3, :3] -= METRES * np.array(self._neck.pivot)
        flat = bind.reshape(2, 16)
        inverse = self.accessor(flat, FLOAT, "MAT4", bufferView=self.view(flat))
        return {"joints": [still, turning], "inverseBindMatrices": inverse}

    def _material(self, one: WebPart) -> int:
        """Return the index of a part's material; the same one is kept once."""
        if one.part.worn is not None:
            return self._worn_material(one.part.worn)
        kind, (picture, mime) = one.part.material, _picture(one)
        key = kind, picture
        if key not in self._known:
            self._known[key] = len(self._materials)
            table = materials().get(kind, materials()["skin"])
            surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": table["roughness"]}
            if picture:
                surface["baseColorTexture"] = {"index": self._texture(kind, picture, mime)}
            self._materials.append({"name": kind, "pbrMetallicRoughness": surface, **_blending(kind, table)})
        return self._known[key]

    def _worn_material(self, worn: Accessory) -> int:
        """Return the index of an accessory's own material; its colour is that of its vertices."""
        material, (picture, mime) = material_of(worn, (1.0, 1.0, 1.0, 1.0)), web_texture(worn)
        if picture:
            texture = self._texture(worn.kind, picture, mime, wrap_of(worn))
            material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": texture}
        self._materials.append(material)
        return len(self._materials) - 1

    def _texture(self, kind: str, picture: bytes, mime: str = "image/png", wrap: int = 0) -> int:
        wrap = wrap or (_REPEAT if kind in _HAIR else _CLAMP)
        sampler = {"magFilter": _LINEAR, "minFilter": _MIPMAPS, "wrapS": wrap, "wrapT": wrap}
        if sampler not in self._samplers:
            self._samplers.append(sampler)
        view = self.view(np.frombuffer(picture, np.uint8))
        self._images.append({"name": kind, "mimeType": mime, "bufferView": view})
        self._textures.append({"source": len(self._images) - 1, "sampler": self._samplers.index(sampler)})
        return len(self._textures) - 1


def _blending(kind: str, table: dict[str, Any]) -> dict[str, Any]:
    two_sided = {"doubleSided": table.get("two_sided", False)}
    if kind in _FADES:
        return {**two_sided, "alphaMode": "BLEND"}
    return {**two_sided, "alphaMode": "MASK", "alphaCutoff": STRAND_CUTOFF} if kind in _HAIR else two_sided


def _picture(one: WebPart) -> tuple[bytes, str]:
    """Return a part's picture and its kind: of its head's texture, or drawn here; empty without one."""
    if one.part.texture is not None:
        return one.part.texture.picture, one.part.texture.mime
    drawn = _drawn_picture(one)
    return (b"", "") if drawn is None else (png_bytes(drawn), "image/png")


def _drawn_picture(one: WebPart) -> Picture | None:
    kind = one.part.material
    if kind == "eye":
        return eye_picture(one.part)
    if kind in _FADES:
        return strip_picture(*_FADES[kind])
    return strand_picture() if kind in _HAIR else None


def _grid(vertices: list[Floats32], middle: Floats | None = None) -> tuple[Floats, float]:
    """Return the middle (3,) and step, mm, of whole steps that reach all vertices from the middle with 16 bits."""
    if not vertices:
        return np.zeros(3), 1.0
    low, high = (edge(np.concatenate(vertices), axis=0).astype(float) for edge in (np.min, np.max))
    centre = 0.5 * (low + high) if middle is None else np.asarray(middle, float)
    reach = max(float(np.abs(np.stack([low, high]) - centre).max()), 1.0)
    return centre, 1.25 * reach / _MAX_STEPS  # moves go further than the face at rest


def _normal_steps(normals: Floats32) -> Array:
    """Return 16-bit normals, a little coarse, so that they compress."""
    steps = _COARSE_NORMAL * np.rint(normals * (32_767 / _COARSE_NORMAL))
    found: Array = np.clip(steps, -32_767, 32_767).astype(np.int16)
    return found


def _colour_steps(colours: Floats32) -> Array:
    """Return 16-bit linear colours of 256 steps as the eye sees them, so that they compress."""
    seen = np.rint(np.sqrt(colours) * 255.0) / 255.0
    steps: Array = np.rint(seen**2 * 65_535.0).astype(np.uint16)
    return steps
