"""Reader of the colours of glTF materials: base colour, its texture as it is encoded, and how opaque they are.

Colours do not change where a mesh lies, so nothing in here refuses a file: what is damaged, or in a format that is not
known, is left out. Read are glTF 2.0, section 3.9, and the extensions ``KHR_texture_transform``, ``EXT_texture_webp``,
``KHR_texture_basisu`` (its fall-back picture only), ``KHR_materials_pbrSpecularGlossiness`` and the colours that VRM 0
gives beside glTF's (``extensions.VRM.materialProperties``).
"""

from __future__ import annotations

from math import cos, sin
from typing import Any

from surface.base.errors import FitError
from surface.base.files import DATA_LIMIT
from surface.readers.gltf.container import Gltf
from surface.readers.meshdata import OTHER_PICTURE, Material, kind_of_picture

ALPHA = ("OPAQUE", "MASK", "BLEND")
WHITE = (1.0, 1.0, 1.0, 1.0)
_OLD = "KHR_materials_pbrSpecularGlossiness"
_Rows = tuple[tuple[float, float, float], tuple[float, float, float]]


def read_materials(file: Gltf) -> list[Material]:
    """Return all materials of a file."""
    images = _Images(file)
    return [_material(file, images, k, _table(table)) for k, table in enumerate(file.items("materials"))]


class _Images:
    """The bytes of pictures; a picture of many materials is kept once, and all together take at most ``DATA_LIMIT``."""

    def __init__(self, file: Gltf) -> None:
        self._file, self._found, self._size = file, dict[tuple[str, Any], bytes](), 0

    def bytes_of(self, source: Any) -> bytes:
        """Return the bytes of an image. Raises FitError."""
        image, where = self._file.item("images", source, "texture"), f"images[{source}]"
        place = "bufferView" if "bufferView" in image else "uri"
        value = image.get(place)
        if not isinstance(value, int | str):
            raise self._file.error(f"{where}.{place}", "is damaged")
        if (place, value) not in self._found:
            read = self._file.view_bytes if place == "bufferView" else self._file.uri_bytes
            data = read(value, where)
            self._size += len(data)
            if self._size > DATA_LIMIT:
                raise self._file.error(where, f"pictures hold more than {DATA_LIMIT >> 20} MB")
            self._found[place, value] = data
        return self._found[place, value]


def _material(file: Gltf, images: _Images, index: int, table: dict[str, Any]) -> Material:
    colour, texture = _colour_and_texture(table)
    if not texture and colour == WHITE:
        colour, texture = _vrm_colour_and_texture(file, index)
    data, mime, lost = _picture(file, images, texture)
    alpha, cutoff = str(table.get("alphaMode", "OPAQUE")), _number(table.get("alphaCutoff"), 0.5)
    name = table.get("name")
    return Material(
        name if isinstance(name, str) else "", colour, data, mime, alpha if alpha in ALPHA else "OPAQUE", cutoff,
        _image_of_uv(_extension(texture, "KHR_texture_transform")), table.get("doubleSided") is True,
        lost,
    )  # fmt: skip


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _extension(table: dict[str, Any], name: str) -> dict[str, Any]:
    return _table(_table(table.get("extensions")).get(name))


def _number(value: Any, default: float) -> float:
    good = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6
    return float(value) if good else default


def _read_colour(value: Any) -> tuple[float, float, float, float]:
    """Return a colour; 1 for each part of it that is missing."""
    every = value if isinstance(value, list) else []
    r, g, b, a = (_number(every[k] if k < len(every) else None, 1.0) for k in range(4))
    return r, g, b, a


def _colour_and_texture(table: dict[str, Any]) -> tuple[tuple[float, float, float, float], dict[str, Any]]:
    """Colour and reference of the texture, of metal and rough materials, or else of the older kind."""
    usual, old = _table(table.get("pbrMetallicRoughness")), _extension(table, _OLD)
    if old and not usual:
        return _read_colour(old.get("diffuseFactor")), _table(old.get("diffuseTexture"))
    return _read_colour(usual.get("baseColorFactor")), _table(usual.get("baseColorTexture"))


def _vrm_colour_and_texture(file: Gltf, index: int) -> tuple[tuple[float, float, float, float], dict[str, Any]]:
    """Return the same of a material of VRM 0, which says it in the terms of its own shader; white where there is
    none.
    """
    every = _extension(file.document, "VRM").get("materialProperties")
    own = _table(every[index]) if isinstance(every, list) and index < len(every) else {}
    texture = _table(own.get("textureProperties")).get("_MainTex")
    r, g, b, a = _read_colour(_table(own.get("vectorProperties")).get("_Color"))
    colour = (_to_linear(r), _to_linear(g), _to_linear(b), a)
    return colour, {} if texture is None else {"index": texture}


def _to_linear(srgb: float) -> float:
    """Return linear intensity of a part of an sRGB colour (IEC 61966-2-1)."""
    return float(srgb / 12.92 if srgb <= 0.04045 else ((srgb + 0.055) / 1.055) ** 2.4)


def _picture(file: Gltf, images: _Images, texture: dict[str, Any]) -> tuple[bytes | None, str, str]:
    """Return the encoded texture, its kind, and why there is none where the material names one. One over the second
    texture coordinates, which are not read, is left out."""
    moved = _extension(texture, "KHR_texture_transform")
    if not texture:
        return None, "", ""
    if moved.get("texCoord", texture.get("texCoord", 0)) != 0:
        return None, "", "it lies over second texture coordinates, which are not read"
    try:
        entry = file.item("textures", texture.get("index"), "texture")
        for source in (_extension(entry, "EXT_texture_webp").get("source"), entry.get("source")):
            data, mime = _image(images, source) if source is not None else (None, "")
            if data is not None:
                return data, mime, ""
    except FitError:
        pass
    return None, "", OTHER_PICTURE


def _image(images: _Images, source: Any) -> tuple[bytes | None, str]:
    """Return the bytes of a picture and its kind; None for a format that cannot be read."""
    data = images.bytes_of(source)
    mime = kind_of_picture(data)
    return (data, mime) if mime else (None, "")


def _image_of_uv(moved: dict[str, Any]) -> _Rows:
    """Return the map from texture coordinates with v up to places in the picture, which ``KHR_texture_transform`` may
    move.

    The extension's matrix is translation times rotation times scale, of coordinates whose v points down.
    """
    (x, y), (sx, sy) = (_pair(moved.get(key), default) for key, default in (("offset", 0.0), ("scale", 1.0)))
    turn = _number(moved.get("rotation"), 0.0)
    c, s = cos(turn), sin(turn)
    return (c * sx, -s * sy, x + s * sy), (-s * sx, -c * sy, y + c * sy)


def _pair(value: Any, default: float) -> tuple[float, float]:
    every = value if isinstance(value, list) and len(value) == 2 else [default, default]
    return _number(every[0], default), _number(every[1], default)
