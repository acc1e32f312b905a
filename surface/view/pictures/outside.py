"""Which sides of an accessory's triangles can be seen at all, from pictures of their numbers from all around.

Hair of a mesh is often made of closed strands in several layers. Nobody sees the strands' insides nor what other
strands hide, but a software renderer looks at every such triangle in each pixel that it covers. Done once when a head
is made, and kept with its accessories.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surface.head import Head, load_data
from surface.head.model.accessories import Accessory, read_accessories, write_accessories
from surface.head.posing.part import HeadPart
from surface.view.draw.programs import build, set_uniforms
from surface.view.pictures.occlusion import OPEN, orthographic, sphere_directions
from surface.view.pictures.offscreen import open_context

if TYPE_CHECKING:
    import moderngl

#: Views from all around, and pixels along the side of each.
DIRECTIONS, RESOLUTION = 192, 640
#: How much nearer to the viewer accessories are taken, mm: live pictures have fewer triangles of skin, and draw
#: accessories before what is as near.
NEARER_MM = 2.0
#: How much further away backs are taken than fronts, mm: both are as near at the outline of what is closed.
BACK_MM = 0.5
#: In so many pixels of a picture a back must be seen, for the same reason.
BACK_PIXELS = 2
#: Skin that poses move further hides nothing, mm.
STILL_MM = 1.0
#: Triangles narrower than this may lie between the pixels of all pictures, mm.
NARROW_MM = 1.5
#: Share of the head's rotation from which on something keeps its place beside the head's other parts.
FIXED = 0.999
#: Triangles have numbers from 1 to this in the pictures.
MAX_NUMBER = (1 << 24) - 1
_WELD_MM = 1e-3
_FRONT, _BACK = 0, 1


def find_outside(folder: str | Path) -> Path | None:
    """Find what can be seen of the accessories of the head in ``folder`` and keep it with them; returns the file
    written, None where there are none.

    Raises HeadFileError: the head cannot be read or written. ViewError: no OpenGL on this machine.
    """
    accessories = read_accessories(folder)
    if not accessories:
        return None
    head = Head(load_data(folder), str(folder))  # without the files beside it, which may belong to another head
    return write_accessories(folder, with_outside(head, accessories))


def with_outside(head: Head, accessories: Sequence[Accessory]) -> tuple[Accessory, ...]:
    """Return accessories of a head with their ``outside``, where one does not see through them; the head is left at
    rest.

    A side of a triangle counts as seen if it is seen from any direction. Parts hide something only where they turn with
    the whole head and stay as the mouth opens and the eyes shut. Of accessories, what turns less hides only what turns
    less, too. Raises ViewError: no OpenGL on this machine.
    """
    solid = [one for one in accessories if one.alpha == "OPAQUE"]
    if not solid or sum(len(one.triangles) for one in solid) > MAX_NUMBER:
        return tuple(accessories)
    seen = _seen_sides(head, solid)
    own = np.split(seen, np.cumsum([len(one.triangles) for one in solid])[:-1])
    known = iter(
        [replace(one, outside=_facing(one.triangles, _widened(one, s))) for one, s in zip(solid, own, strict=True)]
    )
    return tuple(next(known) if one.alpha == "OPAQUE" else one for one in accessories)


def _facing(triangles: NDArray[np.int32], seen: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(k, 3) triangles whose fronts are seen, and those whose backs are, turned round; ``seen (t, 2)``."""
    return np.concatenate([triangles[seen[:, _FRONT]], triangles[seen[:, _BACK]][:, ::-1]])


def _widened(accessory: Accessory, seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """``seen (t, 2)`` and the fronts of narrow triangles beside those that are seen: they lie between pixels."""
    steps = np.rint(accessory.vertices / _WELD_MM).astype(np.int64)
    _, place = np.unique(steps, axis=0, return_inverse=True)
    corners, near = place.ravel()[accessory.triangles], np.zeros(len(steps), np.bool_)
    near[corners[seen[:, _FRONT]]] = True
    out = seen.copy()
    out[:, _FRONT] |= near[corners].any(axis=1) & (_widths(accessory) < NARROW_MM)
    return out


def _widths(accessory: Accessory) -> NDArray[np.floating]:
    """(t,) least heights of triangles, mm."""
    corner = accessory.vertices[accessory.triangles].astype(np.float64)
    edges = corner - np.roll(corner, -1, axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    double = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return np.asarray(double / np.maximum(longest, 1e-9))


def _seen_sides(head: Head, solid: Sequence[Accessory]) -> NDArray[np.bool_]:
    """(t, 2) whether fronts and backs of all triangles of accessories are seen."""
    ctx = open_context()
    try:
        pictures = _SidePictures(ctx, head, solid)
        seen = np.zeros((pictures.count, 2), np.bool_)
        for pixels in pictures.look():
            seen |= pixels >= (1, BACK_PIXELS)
        return seen[1:]
    finally:
        ctx.release()


class _SidePictures:
    """Pictures of the numbers of accessories' triangles, from 1 on, before a head, whose number is 0.

    count : of numbers, 1 + t.
    """

    def __init__(self, ctx: moderngl.Context, head: Head, solid: Sequence[Accessory]) -> None:
        self._ctx = ctx
        self._program = build(ctx, ("sides.vert",), ("sides.frag",))
        corners = np.concatenate([one.vertices[one.triangles].reshape(-1, 3) for one in solid])
        triangles = len(corners) // 3
        self.count = triangles + 1
        share = np.concatenate([head.data.neck.share(one.vertices.astype(float))[one.triangles] for one in solid])
        fixed = (share > FIXED).all(axis=1)
        rows = _numbered(corners, np.arange(1, self.count)).reshape(triangles, 3)
        self._points = corners.astype(np.float64)
        # What turns with the whole head comes first: the rest does not hide it.
        self._worn = [self._array(rows[which]) for which in (fixed, ~fixed) if which.any()]
        self._parts = [self._of_part(part, still) for part, still in _still(head)]
        self._around = np.concatenate([np.asarray(part.vertices, np.float64) for part in head.parts])
        colour = ctx.texture((RESOLUTION, RESOLUTION), 4)
        self._target = ctx.framebuffer([colour], ctx.depth_renderbuffer((RESOLUTION, RESOLUTION)))

    def look(self) -> Iterator[NDArray[np.int64]]:
        """(count, 2) how many pixels have the front and the back of each number, picture after picture."""
        for direction in sphere_directions(DIRECTIONS):
            around = np.concatenate([self._around, self._points + NEARER_MM * direction])
            _, matrix, _ = orthographic(self._points, direction, around)
            self._target.use()
            self._ctx.enable_only(self._ctx.DEPTH_TEST)
            self._target.clear(depth=1.0)
            set_uniforms(self._program, {"view_projection": matrix, "nearer": (0.0, 0.0, 0.0)})
            for array in self._parts:
                array.render()
            for array in self._worn:
                self._draw_sides(array, direction)
                yield _pixels(self._target, self.count)

    def _draw_sides(self, array: moderngl.VertexArray, direction: NDArray[np.floating]) -> None:
        """Draw the fronts and the backs of triangles of accessories, seen from a direction (3,)."""
        self._ctx.enable_only(self._ctx.DEPTH_TEST | self._ctx.CULL_FACE)
        for culled, nearer in (("back", NEARER_MM), ("front", NEARER_MM - BACK_MM)):
            self._ctx.cull_face = culled
            set_uniforms(self._program, {"nearer": nearer * direction})
            array.render()

    def _of_part(self, part: HeadPart, still: NDArray[np.bool_]) -> moderngl.VertexArray:
        """What hides something of a part: triangles all of whose vertices are ``still`` (m,)."""
        triangles = np.asarray(part.mesh.triangles, np.int32)
        positions = self._ctx.buffer(np.asarray(part.vertices, "<f4").tobytes())
        numbers = self._ctx.buffer(np.zeros(len(part.vertices), "<u4").tobytes())
        index = self._ctx.buffer(triangles[still[triangles].all(axis=1)].tobytes() or bytes(12))
        content = [(positions, "3f", "position"), (numbers, "4f1", "number")]
        return self._ctx.vertex_array(self._program, content, index, 4)

    def _array(self, rows: NDArray[np.void]) -> moderngl.VertexArray:
        return self._ctx.vertex_array(
            self._program, [(self._ctx.buffer(rows.tobytes()), "3f 4f1", "position", "number")]
        )


def _still(head: Head) -> Iterator[tuple[HeadPart, NDArray[np.bool_]]]:
    """Each part with which of its vertices (m,) turn with the whole head and stay where they are in an open pose; the
    head is left at rest."""
    head.pose(head.values(OPEN))
    opened = [np.array(part.vertices) for part in head.parts]
    head.pose(head.values({}))
    for part, moved in zip(head.parts, opened, strict=True):
        share = np.asarray(part.share)  # without the vertices that seams have added
        near = np.linalg.norm(moved - part.vertices, axis=1)[: len(share)] < STILL_MM
        yield part, near & (share > FIXED)


def _numbered(corners: NDArray[np.floating], numbers: NDArray[np.int64]) -> NDArray[np.void]:
    """(3 t,) rows of corners (3 t, 3), mm, with the numbers (t,) of their triangles as colours."""
    rows = np.zeros(len(corners), [("position", "<f4", 3), ("number", "<u4")])
    rows["position"], rows["number"] = corners, np.repeat(numbers, 3)
    return rows


def _pixels(target: moderngl.Framebuffer, count: int) -> NDArray[np.int64]:
    """(count, 2) how many pixels of a picture have the front and the back of each number below ``count``."""
    found = np.frombuffer(target.read(components=4), "<u4").astype(np.int64)
    sides = 2 * (found & MAX_NUMBER) + np.where(found >> 24 > 127, _FRONT, _BACK)
    return np.bincount(sides, minlength=2 * count).reshape(count, 2)
