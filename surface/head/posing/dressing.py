"""What is worn, on the parts of a head: colours and strands of its own parts, and what it does to the skin below; and
accessories, which turn with the head."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.accessories import Accessory
from surface.head.model.data import Neck
from surface.head.model.look import Worn
from surface.head.model.wardrobe import HINT, Garment, WornPart
from surface.head.posing.part import HeadPart, Turn

COVERED = 0.5  # of the picture of hidden skin: more is not drawn
SCALP = 0.6  # of hair's brightness on the skin between its roots, where little light reaches
ALONG_MM = 900.0  # of strands for a tile of their texture along them, as surface.fit.wardrobe makes them
SHADED = 0.6  # of the light that falls on skin between roots, what hair keeps from it: else it shines grey
CURLED_MM = (
    40.0  # of strands for a tile of their texture: where it is shorter, strands turn, and none has one direction
)
ENDS_MM = 16.0, 32.0  # of a parting, over which hair closes it at its front end, and before its highest place
NOT_BARE_MM = 4.0  # from the parting, where strand.frag shows no skin
SKIN = 0.8  # of the hue of skin between roots, what is its own: with that of grey hair it would look bluish
THROUGH = 0.8  # of the skin between roots of hair that is light, which lets light through and shows less on it


def dress(parts: Iterable[HeadPart], garments: Sequence[Garment]) -> None:
    """Give worn parts their attributes, and colour and hide the skin below them.

    Raises HeadFileError: a garment's colours belong to another mesh than the one it is drawn with.
    """
    of = {part.name: part for part in parts}
    for garment in garments:
        for worn in garment.parts:
            if len(of[worn.name].vertices) != len(worn.arrays["strands"]):  # its mesh was made again: it did not fit
                why = f"{worn.name}/strands belongs to another mesh"
                raise HeadFileError(f"{garment.worn.path}: is damaged: {why}", hint=HINT)
            _colour(of[worn.name], worn, garment.worn)
            if of[worn.name].material == "tress":
                _show_parting(of[worn.name], garment, of.values())
    for part in of.values():
        if part.material == "skin":
            _colour_below(part, garments)
            _hide_below(part, garments)


def _colour(part: HeadPart, worn: WornPart, look: Worn) -> None:
    """Colours, strands and directions of strands at every vertex."""
    a = worn.arrays
    root, tip = np.asarray(look.colour), np.asarray(look.tips or look.colour)
    tint, shade = np.asarray(a["tint"], float)[:, None] / 255, np.asarray(a["shade"], float)[:, None] / 128
    part.attributes["albedo"] = np.clip((root + tint * (tip - root)) * shade, 0.0, 1.0).astype(np.float32)
    part.attributes["strands"] = np.asarray(a["strands"], np.float32)
    part.attributes["gloss"] = np.full((len(part.vertices), 1), look.gloss, np.float32)
    part.attributes["along"] = _directions(part)
    fast = np.asarray(a["fast"], np.int32)
    part.decimated = {"fast": fast, "full": fast}  # stills have all


def _show_parting(part: HeadPart, garment: Garment, others: Iterable[HeadPart]) -> None:
    """Give hair that hangs from a parting ``roots``, (m, 1) mm from the roots along the strands, and ``scalp``, (m, 3)
    how much brighter than the hair's roots the skin is that shows there."""
    along, patch = part.attributes["strands"][:, 1], np.floor(np.asarray(part.uv)[:, 0] / 2.0).astype(int)
    first = np.full(patch.max(initial=0) + 1, np.inf)
    np.minimum.at(first, patch, along)
    roots = ALONG_MM * (along - first[patch]) + NOT_BARE_MM * _parting_closed(part, patch)
    part.attributes["roots"] = np.asarray(roots[:, None], np.float32)
    skins = [
        other.attributes["albedo"][cover[:, 0] > COVERED]
        for other in others
        if other.material == "skin" and "albedo" in other.attributes
        if (cover := sample_picture(garment, "cover", other)) is not None
    ]
    under = np.concatenate([np.zeros((0, 3), np.float32), *skins])
    if len(under):
        ratio = under.mean(axis=0) / np.maximum(garment.worn.colour, 1e-3)
        part.attributes["scalp"] = np.tile(ratio.astype(np.float32), (len(along), 1))


def _parting_closed(part: HeadPart, patch: NDArray[np.int_]) -> Floats:
    """(m,) how closed the parting is at the strand of each vertex, 0..1: hair closes over it towards its front end and
    from its highest place on, where skin would be seen as a notch in the head's outline.

    patch : (m,) which sheet each vertex belongs to. Its rows run along the parting, its columns away from it.
    """
    u, v = np.asarray(part.uv, float).T
    closed = np.zeros(len(u))
    for each in np.unique(patch):
        own = np.flatnonzero(patch == each)
        roots = own[v[own] == v[own].min()]
        roots = roots[np.argsort(u[roots])]
        at = part.vertices[roots].astype(float)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
        before = along if at[0, 2] > at[-1, 2] else along[-1] - along  # mm from the front end
        left = np.minimum(before / ENDS_MM[0], (before[at[:, 1].argmax()] - before) / ENDS_MM[1])
        closed[own] = np.interp(u[own], u[roots], 1.0 - np.clip(left, 0.0, 1.0))
    return closed


def _directions(part: HeadPart) -> Floats32:
    """Return (m, 3): unit vectors along the strands at rest: those of v."""
    _, _, along = part.surface.derivatives(part.mesh.uv, side=part.mesh.side)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(_straightness(part) * along / np.maximum(length, 1e-9), np.float32)


def _straightness(part: HeadPart) -> float:
    """Return 1 of straight strands, and less of curls, whose texture changes along them within a few mm."""
    within = np.diff(part.mesh.uv[:, 0]) == 0.0
    steps = np.linalg.norm(np.diff(part.vertices, axis=0), axis=1)[within]
    tiles = np.abs(np.diff(part.attributes["strands"][:, 1]))[within]
    if not tiles.any():
        return 1.0
    return float(min(1.0, steps.sum() / tiles.sum() / CURLED_MM))


def _colour_below(part: HeadPart, garments: Sequence[Garment]) -> None:
    albedo = part.attributes.get("albedo")
    if albedo is None:
        return
    for garment in garments:
        cover = sample_picture(garment, "cover", part)
        if cover is not None:
            hair = SCALP * np.asarray(garment.worn.colour, np.float32)
            dark = np.minimum(hair.mean() / np.maximum(albedo.mean(axis=1, keepdims=True), 1e-3), 1.0)
            share = cover * (1.0 - THROUGH * dark)
            below = hair + SKIN * (dark * albedo - hair)  # as dark as the hair, and light hair makes no skin lighter
            albedo = albedo + share * (below - albedo)
            for name, less in (("occlusion", SHADED), ("gloss", 1.0)):  # what hair covers does not shine
                if name in part.attributes:
                    part.attributes[name] = part.attributes[name] * (1.0 - less * share)
        shadow = sample_picture(garment, "shadow", part)
        if shadow is not None and "occlusion" in part.attributes:
            part.attributes["occlusion"] = part.attributes["occlusion"] * (1.0 - shadow)
    part.attributes["albedo"] = albedo.astype(np.float32)


def _hide_below(part: HeadPart, garments: Sequence[Garment]) -> None:
    """Leave out triangles all of whose corners are covered: they cost time and might show through."""
    covered = np.zeros(len(part.vertices), bool)
    for garment in garments:
        hidden = sample_picture(garment, "hidden", part)
        if hidden is not None:
            covered |= hidden[:, 0] > COVERED
    if covered.any():
        part.triangles = _seen(part.triangles, covered)
        part.decimated = {level: _seen(triangles, covered) for level, triangles in part.decimated.items()}


def _seen(triangles: NDArray[np.int32], covered: NDArray[np.bool_]) -> NDArray[np.int32]:
    return triangles[~covered[triangles].all(axis=1)]


def sample_picture(garment: Garment, kind: str, part: HeadPart) -> Floats32 | None:
    """Return (m, 1): a garment's picture over a part at its vertices, linear between pixels; None where it has none."""
    picture = garment.fields.get(f"{kind}/{part.name}")
    if picture is None:
        return None
    at: Floats = np.clip(np.asarray(part.uv, float), 0.0, 1.0) * (np.array(picture.shape) - 1)
    low = np.minimum(np.floor(at).astype(int), np.array(picture.shape) - 2)
    (i, j), (s, t) = low.T, (at - low).T
    rows = picture[i, j] * (1 - t) + picture[i, j + 1] * t, picture[i + 1, j] * (1 - t) + picture[i + 1, j + 1] * t
    return np.asarray(rows[0] * (1 - s) + rows[1] * s, np.float32)[:, None]


class WornMesh:
    """An accessory of a head: it turns with the head, and what hangs over the neck by the neck's share.

    accessory : at rest. share : (m,) float32, of the head's rotation that each vertex takes, 0..1. pivot : (3,) mm.
    """

    def __init__(self, accessory: Accessory, neck: Neck) -> None:
        self.accessory, self.pivot = accessory, neck.pivot
        self.share = neck.share(accessory.vertices.astype(np.float64)).astype(np.float32)
        self._rest = _read_only(accessory.vertices), _read_only(accessory.normals)
        self._last: tuple[bytes, Floats32, Floats32] = b"", *self._rest

    def turned(self, matrix: Floats) -> tuple[Floats32, Floats32]:
        """Return vertices and normals (m, 3) with the head turned by ``matrix`` (3, 3); read-only."""
        turn = Turn(np.asarray(matrix, np.float64), self.pivot)
        if turn.none:
            return self._rest
        if turn.key != self._last[0]:
            vertices, normals = np.empty_like(self.accessory.vertices), np.empty_like(self.accessory.normals)
            turn.rotate(self.accessory, self.share, (0, len(self.share)), vertices, normals)
            self._last = turn.key, _read_only(vertices), _read_only(normals)
        return self._last[1:]


def _read_only(rows: Floats32) -> Floats32:
    """Return the same numbers for those who must not change them."""
    view = rows.view()
    view.flags.writeable = False
    return view
