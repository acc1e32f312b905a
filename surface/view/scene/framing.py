"""Where a head's face is and how large it is, so that every camera shows it as it shows the shipped head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from surface.view.scene.camera import Camera
from surface.view.scene.parts import ViewHead

#: Of the shipped head, which the presets of :class:`surface.view.scene.camera.Camera` are made for, mm: the middle
#: between its eyes, its crown above it, its lips below it, half its width at the ears, and of what blinks.
EYES, CROWN, LIPS, HALF_WIDTH = np.array([0.0, 36.1, 84.2]), 108.7, 68.0, 92.1
LIDS = np.array([0.0, 36.6, 93.6])
NEAR_MM, NEAR_SIZE = 12.0, 0.15  # a head that differs from it by less is shown from the same places
LIPS_SHAPES = ("mouthPucker", "mouthFunnel", "mouthClose", "mouthRollLower", "mouthRollUpper", "jawOpen")
WORN_UP, WORN_ASIDE, WORN_BACK = 126.0, 155.0, 230.0  # mm from the middle of its eyes that its pictures show
MOST_UP = 55.0  # mm on the shipped head: so far up a camera looks for what is worn before it steps back
MOST_WORN = 1.4  # times a head's size: what is worn is shown by that much smaller at most
MOST_OF_IT = 0.99  # of the area of what is worn that a camera makes room for: stray cards may lie further out
BLINKS = ("eyeBlinkLeft", "eyeBlinkRight")
SKIN, SAMPLES = "skin", 400  # places of a part that its outline is measured at


@dataclass(frozen=True)
class Framing:
    """A move and a scale that bring the shipped head's place to a head's.

    at : (3,) mm, the middle of its eyes. size : relative to the shipped head's; greater where cameras make room for
    what it wears. up : mm, by how much cameras look higher for that.
    """

    at: tuple[float, float, float] = (float(EYES[0]), float(EYES[1]), float(EYES[2]))
    size: float = 1.0
    up: float = 0.0

    def point(self, place: tuple[float, float, float]) -> tuple[float, float, float]:
        """A place (3,), mm, of a camera at the shipped head as one at this head."""
        if self == Framing():
            return place  # exactly: the shipped head's pictures depend on it
        x, y, z = (np.array(self.at) + self.size * (np.array(place) - EYES)).tolist()
        return x, y + self.up, z

    def camera(self, camera: Camera) -> Camera:
        """A camera made for the shipped head as one that shows this head in the same way."""
        if self == Framing():
            return camera
        eye, target = self.point(camera.eye), self.point(camera.target)
        return replace(camera, eye=eye, target=target, near=self.size * camera.near, far=self.size * camera.far)


def framing_of(head: ViewHead, *, worn: bool = True) -> Framing:
    """The framing of a head, from its eyes, lips and outline at rest; the shipped head's where it hardly differs, and
    for one of which nothing is known. worn : make room for its accessories, too, for pictures that show them (see
    :attr:`surface.view.scene.theme.Theme.dressed`)."""
    data = getattr(head, "data", None)
    if data is None:
        return Framing()
    skin = _skin_points(head)
    if not len(skin):
        return Framing()
    at, known = _eyes(data, skin)
    size = _size(data, skin, at) if known else _height(skin)
    wanted, up = _room(getattr(head, "accessories", ()) if worn else (), at, size)
    near = np.abs(at - EYES).max() < NEAR_MM and abs(np.log(size)) < np.log1p(NEAR_SIZE) and wanted <= 1.0 and up <= 0.0
    return Framing() if near else Framing((float(at[0]), float(at[1]), float(at[2])), max(size, wanted), up)


def framed(camera: Camera, head: ViewHead, *, worn: bool = True) -> Camera:
    """A camera made for the shipped head, as a preset is, moved to a head's own face; ``worn`` as for
    :func:`framing_of`."""
    return framing_of(head, worn=worn).camera(camera)


def _skin_points(head: Any) -> np.ndarray:
    """(n, 3) places all over the skin at rest, whatever the pose is; of all parts where none is skin."""
    parts = [p for p in head.parts if p.material == SKIN] or list(head.parts)
    found = [p.surface.evaluate(_inside(p)) for p in parts if len(p.uv)]
    every = np.concatenate(found) if found else np.zeros((0, 3))
    return every[np.isfinite(every).all(axis=1)]  # by the same rounding a place may lie beyond its chart


def _inside(part: Any) -> np.ndarray:
    """(n, 2) some of a part's places; 32-bit numbers may lie beyond its domain by rounding."""
    u0, u1, v0, v1 = part.surface.rect
    inside: np.ndarray = np.clip(np.asarray(part.uv[:: -(-len(part.uv) // SAMPLES)], float), (u0, v0), (u1, v1))
    return inside


def _eyes(data: Any, skin: np.ndarray) -> tuple[np.ndarray, bool]:
    """The middle of the eyes (3,): of the eyeballs, else behind what blinks, else below the crown; and whether eyes
    determine it."""
    if data.eye_radius > 0:
        return np.asarray(data.eyes, float).mean(axis=0), True
    lids = [m for name in BLINKS if (m := _moved(data, (name,))) is not None]
    if len(lids) == len(BLINKS):
        apart = float(np.linalg.norm(lids[0] - lids[1])) / 63.0
        return np.mean(lids, axis=0) + apart * (EYES - LIDS), True
    low, high = skin.min(axis=0), skin.max(axis=0)
    size = _height(skin)
    return np.array([0.5 * (low[0] + high[0]), high[1] - size * CROWN, high[2] - size * 46.0]), False


def _height(skin: np.ndarray) -> float:
    """Size of a head without known eyes, by its own height and width: the shipped bust is 338 mm high."""
    wide, high = (float(np.ptp(skin[:, k])) for k in (0, 1))
    return max(min(high / 338.0, wide / (2.0 * HALF_WIDTH)), 1e-3)


def _size(data: Any, skin: np.ndarray, at: np.ndarray) -> float:
    """Size of a head relative to the shipped one, so that crown, ears and lips are in the picture as there."""
    lips = _moved(data, LIPS_SHAPES)
    face = (at[1] - lips[1]) / LIPS if lips is not None else 0.0
    if data.eye_radius > 0:
        face = max(face, 0.5 * float(np.linalg.norm(data.eyes[0] - data.eyes[1])) / 31.8)
    crown = (float(skin[:, 1].max()) - at[1]) / CROWN
    level = skin[np.abs(skin[:, 1] - at[1]) < max(face, 0.2 * crown, 1e-3) * LIPS]
    wide = float(np.abs(level[:, 0] - at[0]).max()) / HALF_WIDTH if len(level) else 0.0
    outline = max(crown, wide)
    return float(max(min(max(outline, 0.7 * face), 2.5 * face) if face > 0 else outline, 1e-3))


def _room(accessories: Sequence[Any], at: np.ndarray, size: float) -> tuple[float, float]:
    """Size at which cameras show the hats and hair around a head of ``size``, and how far up they look for it, mm."""
    corners = _worn_triangles(accessories, at, size)
    if not len(corners):
        return 0.0, 0.0
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    ends = corners[..., 1].max(axis=1), np.abs(corners[..., 0]).max(axis=1), -corners[..., 2].min(axis=1)
    top, wide, back = (_share_below(each, area, MOST_OF_IT) for each in ends)
    wanted = min(max(wide / WORN_ASIDE, back / WORN_BACK, top / (WORN_UP + MOST_UP)), MOST_WORN * size)
    shown = max(size, wanted)
    return float(wanted), float(np.clip(top - WORN_UP * shown, 0.0, MOST_UP * shown))


def _worn_triangles(accessories: Sequence[Any], at: np.ndarray, size: float) -> np.ndarray:
    """(t, 3, 3) corners, mm from ``at``, of the triangles that make up what is worn: those above the lips, for hair may
    hang down out of a picture, and not so far from the head that no camera shows them."""
    found = [one.accessory.vertices[one.accessory.triangles] for one in accessories]
    corners = np.concatenate([np.zeros((0, 3, 3)), *found]) - at
    reach = MOST_WORN * size * np.array([WORN_ASIDE, WORN_UP + MOST_UP, WORN_BACK])
    near = (corners.min(axis=1) < reach).all(axis=1) & (corners.max(axis=1) > -reach).all(axis=1)
    kept: np.ndarray = corners[near & (corners[..., 1].mean(axis=1) > -size * LIPS)]
    return kept


def _share_below(values: np.ndarray, weight: np.ndarray, share: float) -> float:
    """The least of ``values`` (n,) that is not exceeded by so much of the ``weight`` (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order[min(np.searchsorted(total, share * total[-1]), len(order) - 1)]])


def _moved(data: Any, names: tuple[str, ...]) -> np.ndarray | None:
    """(3,) middle of the skin that the first of the groups ``names`` a head has moves; None if it has none."""
    for name in names:
        found = [(p.points[g.ids], np.linalg.norm(g.moves, axis=1)) for p in data.parts if p.material == SKIN
                 for g in p.groups if g.name == name]  # fmt: skip
        points, weight = (np.concatenate([x[k] for x in found] or [np.zeros(0)]) for k in (0, 1))
        if weight.sum() > 0:
            return _weighted_median(points, weight)
    return None


def _weighted_median(points: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(3,) of points (n, 3): a few control points may lie far off and move far."""
    out = np.zeros(3)
    for k in range(3):
        order = np.argsort(points[:, k])
        share = np.cumsum(weight[order])
        out[k] = points[order[np.searchsorted(share, 0.5 * share[-1])], k]
    return out
