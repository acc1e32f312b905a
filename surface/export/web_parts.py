"""Parts of a head for pages of browsers: fewer triangles, only their vertices, and colours as omote draws them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Floats32, Ints
from surface.export.head_texture import tinted
from surface.export.shapes import ExportPart, export_parts, unit
from surface.export.textures import EYE_RIM, materials
from surface.export.worn import accessory_parts
from surface.head import Head
from surface.head.posing.part import HeadPart
from surface.mesh.strips import lower_strips, strip_uv

MIN_MOVE_MM, MIN_NORMAL = 0.03, 0.012
"""Smaller moves of vertices, and smaller changes of their normals, are left out."""
HALVES = ("eyeBlinkLeft", "eyeBlinkRight", "eyeLookDownLeft", "eyeLookDownRight", "jawOpen")
HALF = "Half"
"""Shapes that turn things move them on arcs, not on the chords of a morph target: NAMEHalf is what lies between arc and
chord half way, to be shown at the weight 4 w (1 - w)."""
BREATH, BREATH_MM = "breathRise", 3.0
"""The shape of a breath that lifts the chest by so many mm, which no parameter shows; see :meth:`Head.live`."""
_DEEP_MM = 26.0  # depth behind the lips at which a mouth's inside has lost most of its light
_HAIR_MIDDLE = np.array([0.0, 15.0, 0.0])  # of the hair, mm: locks are shaded as the whole that they make
_LOWER_LASHES = 0.42
_INNER = ("teeth", "gums", "tongue", "mouth")


@dataclass(frozen=True)
class WebPart:
    """One part for a page.

    part : what it has in common with exports of other kinds, with the vertices that its triangles use, and with
        ``displacements`` and ``normal_changes`` of further shapes (see :data:`HALF` and :data:`BREATH`).
    colours : (m, 4) float32 linear RGB and alpha: how open to light it lies (skin), or how much hair covers there.
    uv : (m, 2) float32 as glTF has it, v down; None for a part without texture.
    baked : (m, 4) uint8 by name: light that reaches skin at rest, and how glossy and thin it is.
    """

    part: ExportPart
    colours: Floats32
    uv: Floats32 | None = None
    baked: dict[str, NDArray[np.uint8]] = field(default_factory=dict)


def web_parts(head: Head, level: str = "full") -> list[WebPart]:
    """Return all parts of a head, which is at rest afterwards, with the triangles of ``level`` where it has them."""
    head.live(0.0, 0.0)
    exported = export_parts(head)
    for name in HALVES:
        _add_half(head, name, exported)
    _add_breath(head, exported)
    front = max((float(p.vertices[:, 2].max()) for p in exported if p.material == "teeth"), default=0.0)
    found = []
    for part, own in zip(exported, head.parts, strict=True):
        triangles = own.decimated.get(level)
        kept, small = _reduce(part, part.triangles if triangles is None else triangles)
        found.append(_add_material_data(small, own, kept, front))
    return found


def worn_web_parts(head: Head) -> list[WebPart]:
    """Return the accessories of a head, with their own colour and shade at every vertex."""
    return [
        WebPart(part, _rgba(worn.shade[:, None] * np.array(worn.colour[:3]), worn.colour[3], len(worn.shade)), worn.uv)
        for part in accessory_parts(head)
        if (worn := part.worn) is not None
    ]


def _add_half(head: Head, name: str, parts: list[ExportPart]) -> None:
    if not any(name in part.displacements for part in parts):
        return
    head.pose(head.values({name: 0.5}))
    for part, own in zip(parts, head.parts, strict=True):
        if name in part.displacements:
            part.displacements[name + HALF] = own.vertices - part.vertices - 0.5 * part.displacements[name]
            part.normal_changes[name + HALF] = unit(own.normals) - part.normals - 0.5 * part.normal_changes[name]
    head.pose(head.values({}))


def _add_breath(head: Head, parts: list[ExportPart]) -> None:
    head.live(BREATH_MM, 0.0)
    head.pose(head.values({}))
    for part, own in zip(parts, head.parts, strict=True):
        part.displacements[BREATH] = own.vertices - part.vertices
        part.normal_changes[BREATH] = unit(own.normals) - part.normals
    head.live(0.0, 0.0)
    head.pose(head.values({}))


def _reduce(part: ExportPart, triangles: NDArray[np.integer]) -> tuple[Ints, ExportPart]:
    """Return the vertices (k,) that triangles (t, 3) use, ascending, and the part of these, without shapes that hardly
    move."""
    kept = np.unique(triangles)
    moves, turns = {}, {}
    for name, rows in part.displacements.items():
        move, turn = rows[kept], part.normal_changes[name][kept]
        here = np.abs(move).max(axis=1) >= MIN_MOVE_MM
        if here.any():
            moved = (here | (np.abs(turn).max(axis=1) >= MIN_NORMAL))[:, None]
            moves[name], turns[name] = np.where(moved, move, 0.0), np.where(moved, turn, 0.0)
    return kept, replace(
        part, vertices=part.vertices[kept], normals=part.normals[kept], uv=part.uv[kept],
        triangles=np.searchsorted(kept, triangles).astype(np.int32), displacements=moves, normal_changes=turns,
        colours=None if part.colours is None else part.colours[kept],
    )  # fmt: skip


def _add_material_data(part: ExportPart, own: HeadPart, kept: Ints, front: float) -> WebPart:
    """Return the part with what its material needs; ``front`` : the front of the teeth, mm."""
    a = _Attributes(own, kept)
    table = materials().get(part.material, materials()["skin"])
    plain = np.asarray(table["colour"], np.float32)
    shown = None if part.texture is None else (part.uv * [1, -1] + [0, 1]).astype(np.float32)
    if part.material == "eye":
        return WebPart(part, _rgba(np.ones(3), 1.0, len(kept)), _eye_uv(part) if shown is None else shown)
    if part.material in ("brow", "lash"):
        strength = a("strength", 1.0) * (_lash_strength(own, kept) if part.material == "lash" else 1.0)
        return WebPart(part, _rgba(a("albedo", plain), strength, len(kept)), _strip_uv(own, kept))
    if part.material in ("strand", "tress"):
        strands = a("strands", (0.0, 0.0, 1.0, 1.0))
        whole = unit(part.normals + 1.1 * unit(part.vertices - _HAIR_MIDDLE.astype(np.float32)))
        albedo = a("albedo", plain) * strands[:, 3:] ** 0.5
        return WebPart(replace(part, normals=whole), _rgba(albedo, strands[:, 2:3], len(kept)), strands[:, :2])
    open_ = a("occlusion", 1.0)
    if part.material in _INNER:
        deep = np.exp(-np.maximum(front - part.vertices[:, 2:], 0.0) / _DEEP_MM)
        return WebPart(part, _rgba(plain * np.sqrt(open_) * deep, 1.0, len(kept)))
    colours = _rgba(tinted(a("albedo", plain), part.texture) * np.sqrt(open_), open_, len(kept))
    if part.material != "skin":
        return WebPart(part, colours)
    surface = np.hstack([a("gloss", 0.3), a("thin", 0.0), np.zeros((len(kept), 2), np.float32)])
    return WebPart(
        part, colours, shown, baked={"_VISIBLE": _bytes(a("visible", (0.75, 0.5, 0.5, 0.5))), "_SKIN": _bytes(surface)}
    )


class _Attributes:
    """Attributes of the vertices ``kept`` of a part, (k, c) float32, or a default for all of them."""

    def __init__(self, part: HeadPart, kept: Ints) -> None:
        self._part, self._kept = part, kept

    def __call__(self, name: str, default: float | tuple[float, ...] | Floats32) -> Floats32:
        rows = self._part.attributes.get(name)
        if rows is None:
            return np.tile(np.atleast_1d(np.asarray(default, np.float32)), (len(self._kept), 1))
        return np.asarray(rows, np.float32).reshape(len(rows), -1)[self._kept]


def _rgba(colour: Floats | Floats32, alpha: float | Floats | Floats32, count: int) -> Floats32:
    rows = np.empty((count, 4), np.float32)
    rows[:, :3], rows[:, 3:] = np.clip(colour, 0.0, 1.0), np.clip(alpha, 0.0, 1.0)
    return rows


def _bytes(shares: Floats32) -> NDArray[np.uint8]:
    found: NDArray[np.uint8] = np.rint(np.clip(shares, 0.0, 1.0) * 255.0).astype(np.uint8)
    return found


def _eye_uv(part: ExportPart) -> Floats32:
    """Return (m, 2): an eyeball looked at from its front; behind its equator everything is as at the equator."""
    away = part.vertices - part.pivot.astype(np.float32)
    if not part.pivot.any():
        away = part.vertices - part.vertices.mean(axis=0)
    local = unit(away)
    across = np.linalg.norm(local[:, :2], axis=1, keepdims=True)
    flat = np.where(local[:, 2:] >= 0.0, local[:, :2], local[:, :2] / np.maximum(across, 1e-6))
    uv: Floats32 = (0.5 + EYE_RIM * flat * np.array([1.0, -1.0])).astype(np.float32)
    return uv


def _strip_uv(own: HeadPart, kept: Ints) -> Floats32:
    """Return (m, 2): along a strip of hair and from its tips down."""
    uv: Floats32 = strip_uv(own)[kept]
    uv[:, 1] = 1.0 - uv[:, 1]
    return uv


def _lash_strength(own: HeadPart, kept: Ints) -> Floats:
    """Return the strength (m, 1) of lashes; those of the lower lid are fainter."""
    return np.where(lower_strips(own)[kept][:, None], _LOWER_LASHES, 1.0)
