"""Accessories of a head for export: meshes that it wears as they are, with their textures."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from itertools import chain, count
from typing import Any

import numpy as np

from surface.base.arrays import Floats32
from surface.base.pictures import decoded
from surface.base.texels import has_clear, reduced
from surface.export.shapes import ExportPart, unit
from surface.head import Head
from surface.head.model.accessories import Accessory
from surface.head.model.parameters import read_pose, rotation

LINEAR, MIPMAPS, REPEAT, CLAMP = 9729, 9987, 10497, 33071  # glTF's numbers
ROUGHNESS = {"hair": 0.6, "hat": 0.9, "glasses": 0.35, "jewellery": 0.25}
WEB_PIXELS, WEB_QUALITY = 512, 80  # of a side of a texture, and of a JPEG, in files for pages


def accessory_parts(head: Head, pose: Mapping[str, float] | None = None) -> list[ExportPart]:
    """Return the accessories of a head as parts, turned as its head is in a pose; their material is their kind."""
    turn = rotation(*read_pose(head.values(pose or {})[: len(Head.parameters)]).head)
    names = _names((one.accessory for one in head.accessories), (part.name for part in head.parts))
    found = list[ExportPart]()
    for one, name in zip(head.accessories, names, strict=True):
        own, (vertices, normals) = one.accessory, one.turned(turn)
        found.append(ExportPart(
            name, own.kind, vertices.copy(), unit(normals), (own.uv * [1, -1] + [0, 1]).astype(np.float32),
            own.triangles, np.zeros(3), _colours(own), worn=own,
        ))  # fmt: skip
    return found


def _names(accessories: Iterable[Accessory], taken: Iterable[str]) -> list[str]:
    """Return a name for each, of the object that it was in its file: on one line, none twice and none of ``taken``."""
    found, used = list[str](), set(taken)
    for one in accessories:
        name = " ".join(c for c in one.name.split("/")[0].split() if c.isprintable()) or one.kind
        numbered = (f"{name} {number}" for number in count(2))
        found.append(next(each for each in chain([name], numbered) if each not in used))
        used.add(found[-1])
    return found


def _colours(accessory: Accessory) -> Floats32 | None:
    """Return (m, 3) how open to light each vertex lies, as a colour; None where all of it is."""
    if (accessory.shade >= 1.0).all():
        return None
    return np.repeat(accessory.shade[:, None], 3, axis=1)


def material_of(accessory: Accessory, colour: tuple[float, ...] | None = None) -> dict[str, Any]:
    """Return the glTF material of an accessory, without its texture; ``colour`` in place of its own."""
    surface = {
        "baseColorFactor": [float(x) for x in colour or accessory.colour], "metallicFactor": 0.0,
        "roughnessFactor": ROUGHNESS[accessory.kind],
    }  # fmt: skip
    table = {"name": accessory.kind, "pbrMetallicRoughness": surface, "doubleSided": accessory.two_sided}
    if accessory.alpha != "OPAQUE":
        table["alphaMode"] = accessory.alpha
    return table | ({"alphaCutoff": accessory.cutoff} if accessory.alpha == "MASK" else {})


def wrap_of(accessory: Accessory) -> int:
    """Return glTF's number for how an accessory's texture goes on beyond its edges."""
    return REPEAT if accessory.repeats else CLAMP


def sampler_of(accessory: Accessory) -> dict[str, int]:
    """Return the glTF sampler of an accessory's texture."""
    wrap = wrap_of(accessory)
    return {"magFilter": LINEAR, "minFilter": MIPMAPS, "wrapS": wrap, "wrapT": wrap}


def web_texture(accessory: Accessory) -> tuple[bytes, str]:
    """Return the texture, and its kind, of at most :data:`WEB_PIXELS`; as it is without Pillow, or where that is
    smaller."""
    kept = accessory.texture, accessory.mime
    if not accessory.texture:
        return kept
    try:
        image = decoded(accessory.texture)
    except (ImportError, ValueError):
        return kept
    clear = accessory.alpha != "OPAQUE" and has_clear(image)
    small = reduced(image, WEB_PIXELS, clear=clear)
    out, kind = io.BytesIO(), "PNG" if clear else "JPEG"
    small.save(out, kind, **({"optimize": True} if clear else {"quality": WEB_QUALITY}))
    packed = out.getvalue()
    return (packed, f"image/{kind.lower()}") if len(packed) < len(accessory.texture) else kept
