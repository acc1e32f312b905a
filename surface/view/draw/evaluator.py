"""Who works out the vertices: the processor, by the head's own engine, or the graphics processor, from control points.

On the graphics processor only control points travel each frame. Weights lie in a texture of floats, uploaded once,
and one pass with transform feedback writes positions and normals into the buffers that are drawn. Textures do what
buffer textures would, without their limit of 65,536 texels in OpenGL 3.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from surface.base.errors import ViewError
from surface.view.draw.programs import build, put
from surface.view.scene.pace import is_software
from surface.view.scene.parts import PartBuffers, ViewHead, ViewPart

if TYPE_CHECKING:
    import moderngl

    from surface.head import Head
    from surface.head.posing.part import Turn

EVALUATORS = ("auto", "cpu", "gpu")
_WIDTH = 1024
_SAMPLERS = 2
_AHEAD = np.eye(3)


class Evaluator(Protocol):
    """What a renderer asks of one.

    ``name`` is "cpu" or "gpu", ``reason`` why it was chosen.
    """

    name: str
    reason: str

    def pose(self, values: np.ndarray) -> None:
        """Move the head to parameter values (P,)."""

    def update(self, parts: Sequence[Any]) -> int:
        """Bring what is drawn up to date; returns how many vertices changed."""

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        """Where vertices `ids` (k,) of a part are now, (k, 3)."""

    def rotation(self) -> np.ndarray:
        """(3, 3) how the head is turned."""

    def release(self) -> None:
        """Give the graphics memory back."""


class CpuEvaluator:
    """The head's own engine; vertices that changed travel."""

    name = "cpu"

    def __init__(self, head: ViewHead, reason: str) -> None:
        self._head, self.reason = head, reason

    def pose(self, values: np.ndarray) -> None:
        self._head.pose(values)

    def update(self, parts: Sequence[PartBuffers]) -> int:
        return sum(buffers.upload() for buffers in parts)

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        positions: np.ndarray = part.vertices[ids]
        return positions

    def rotation(self) -> np.ndarray:
        return np.asarray(getattr(self._head.parts[0], "turn", _AHEAD))

    def release(self) -> None:
        pass


class GpuEvaluator:
    """Sums on the graphics processor; control points travel.

    The head's own vertices and normals are left where they were.

    Parameters
    ----------
    head : a :class:`surface.head.Head`, whose surfaces it knows.
    """

    name = "gpu"

    def __init__(self, ctx: moderngl.Context, head: Head, reason: str) -> None:
        from surface.head.posing.influence import Influence  # compiled: loaded when first used

        self._head, self.reason, self._ctx = head, reason, ctx
        self._sums = Influence(head)
        self._at = {part.name: i for i, part in enumerate(head.parts)}
        self._program = build(
            ctx, ("place.vert",), (), outputs=("out_position", "out_normal"), defines={"WIDTH": _WIDTH}
        )
        entries = np.column_stack([self._sums.weights, self._sums.ids]).astype(np.float32)
        self._weights = _float_texture(ctx, len(entries))
        self._weights.write(_filled(entries, self._weights.height).tobytes())
        self._points = _float_texture(ctx, self._sums.points)
        self._packed = _filled(np.zeros((self._sums.points, 4), np.float32), self._points.height)
        self._passes: dict[str, tuple[moderngl.Buffer, moderngl.VertexArray]] = {}
        self._read: dict[tuple[str, int], tuple[np.ndarray, Any, np.ndarray]] = {}
        # A context without a window has no framebuffer of its own, and without one nothing is worked out.
        self._frame = ctx.framebuffer([ctx.renderbuffer((1, 1), 4)])
        self._turn: Turn | None = None
        self._fresh = True
        put(self._program, {"points": 0, "weights": 1})

    def pose(self, values: np.ndarray) -> None:
        placed, turn = self._head.place_points(values)
        points = np.concatenate(placed).astype(np.float32)
        own = self._packed[: len(points), :3]
        same = self._turn is not None and np.array_equal(self._turn.matrix, turn.matrix) and np.array_equal(own, points)
        own[:], self._turn = points, turn
        self._fresh |= not same

    def update(self, parts: Sequence[PartBuffers]) -> int:
        if not self._fresh or self._turn is None:
            return 0
        self._fresh = False
        angle = float(np.linalg.norm(self._turn.vector))
        put(
            self._program,
            {"axis": self._turn.vector / max(angle, 1e-12), "angle": angle, "pivot": self._turn.pivot},
        )
        self._points.write(self._packed.tobytes())
        self._frame.use()
        self._points.use(0)
        self._weights.use(1)
        for buffers in parts:
            self._pass(buffers.part).transform(buffers.moving, vertices=len(buffers.part.vertices))
        return len(self._sums.share)

    def _pass(self, part: ViewPart) -> moderngl.VertexArray:
        """The transform that fills a part's buffer."""
        if part.name not in self._passes:
            first, last = self._range(part)
            rows = np.zeros(last - first, [("first", "i4"), ("count", "i4"), ("share", "f4")])
            rows["first"] = self._sums.start[first:last]
            rows["count"] = np.diff(self._sums.start[first : last + 1])
            rows["share"] = self._sums.share[first:last]
            content = self._ctx.buffer(rows.tobytes())
            array = self._ctx.vertex_array(self._program, [(content, "1i 1i 1f", "first", "count", "share")])
            self._passes[part.name] = content, array
        return self._passes[part.name][1]

    def _range(self, part: ViewPart) -> tuple[int, int]:
        """First and last + 1 of a part's vertices among all."""
        index = self._at[part.name]
        return int(self._sums.part_start[index]), int(self._sums.part_start[index + 1])

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        key = part.name, id(ids)
        if key not in self._read:
            self._read[key] = ids, *self._sparse(part, ids)
        _, matrix, share = self._read[key]
        at = matrix @ self._packed[: self._sums.points, :3]
        return at if self._turn is None else turned(at, share, self._turn.vector, self._turn.pivot)

    def _sparse(self, part: ViewPart, ids: np.ndarray) -> tuple[Any, np.ndarray]:
        """Matrix (k, points) that gives vertices `ids` of a part before the head turns, and their shares (k,)."""
        from scipy.sparse import csr_matrix  # takes a moment to import

        vertices = self._range(part)[0] + np.asarray(ids)
        low, high = self._sums.start[vertices], self._sums.start[vertices + 1]
        entries = np.concatenate([np.arange(a, b) for a, b in zip(low, high, strict=True)])
        ends = np.cumsum([0, *(high - low)])
        content = self._sums.weights[entries, 0].astype(np.float32), self._sums.ids[entries], ends
        return csr_matrix(content, shape=(len(ids), self._sums.points)), self._sums.share[vertices]

    def rotation(self) -> np.ndarray:
        return _AHEAD if self._turn is None else self._turn.matrix

    def release(self) -> None:
        for content, array in self._passes.values():
            array.release()
            content.release()
        for thing in (*self._frame.color_attachments, self._frame, self._points, self._weights, self._program):
            thing.release()


def turned(points: np.ndarray, share: np.ndarray, turn: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    """Rows of `points` (k, 3) rotated about `pivot` (3,) by their `share` (k,) of the rotation vector `turn` (3,)."""
    angle = float(np.linalg.norm(turn))
    axis = turn / max(angle, 1e-12)
    c, s = np.cos(share * angle)[:, None], np.sin(share * angle)[:, None]
    own = points - pivot
    turned: np.ndarray = pivot + c * own + s * np.cross(axis, own) + (1.0 - c) * (own @ axis)[:, None] * axis
    return turned


def choose(ctx: moderngl.Context, head: ViewHead, wanted: str) -> Evaluator:
    """The evaluator called `wanted`; "auto" takes the graphics processor where there is one and it can.

    Raises
    ------
    ValueError : unknown name.
    ViewError : "gpu" is asked for and cannot be had.
    """
    if wanted not in EVALUATORS:
        raise ValueError(f"evaluator must be one of {', '.join(EVALUATORS)}, not {wanted!r}")
    if wanted == "cpu":
        return CpuEvaluator(head, "asked for")
    lacking = what_lacks(ctx.info, head)
    if wanted == "gpu":
        if lacking is not None:
            raise ViewError(f"the graphics processor cannot evaluate: {lacking}", hint="choose evaluator cpu or auto")
        return GpuEvaluator(ctx, head, "asked for")  # type: ignore[arg-type]
    if is_software(ctx):
        return CpuEvaluator(head, f"{ctx.info['GL_RENDERER']} draws on the processor")
    if lacking is not None:
        return CpuEvaluator(head, lacking)
    return GpuEvaluator(ctx, head, f"{ctx.info['GL_RENDERER']} is a graphics processor")  # type: ignore[arg-type]


def what_lacks(info: Mapping[str, Any], head: ViewHead) -> str | None:
    """Why a head cannot be evaluated on the graphics processor that `info` describes, or None."""
    if not hasattr(head, "place_points"):
        return f"{type(head).__name__} has no control points"
    if info["GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS"] < _SAMPLERS:
        return "vertex shaders here read no textures"
    most = max((len(part.vertices) for part in head.parts), default=0) * 64 // _WIDTH
    if info["GL_MAX_TEXTURE_SIZE"] < max(_WIDTH, most):
        return f"textures of {info['GL_MAX_TEXTURE_SIZE']} texels are too small for the weights"
    return None


def _float_texture(ctx: moderngl.Context, count: int) -> moderngl.Texture:
    """A texture with room for `count` rows of four floats, `_WIDTH` a line."""
    texture = ctx.texture((_WIDTH, max(1, -(-count // _WIDTH))), 4, dtype="f4")
    texture.filter = (ctx.NEAREST, ctx.NEAREST)
    return texture


def _filled(rows: np.ndarray, lines: int) -> np.ndarray:
    """`rows` (k, 4) float32 filled up with zeros to whole lines of a texture."""
    whole = np.zeros((lines * _WIDTH, 4), np.float32)
    whole[: len(rows)] = rows
    return whole
