"""Evaluators of vertices: on the processor by the head's own engine, or on the graphics processor from control points.

On the graphics processor only control points are uploaded each frame; see :mod:`.vertex_sums`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError
from surface.view.draw.vertex_sums import SAMPLERS, WIDTH, VertexSums
from surface.view.scene.parts import ViewHead, ViewPart
from surface.view.scene.sampling import is_software

if TYPE_CHECKING:
    import moderngl

    from surface.head import Head
    from surface.head.posing.part import Turn

EVALUATORS = ("auto", "cpu", "gpu")
ENTRIES = 64
"""Weights that a vertex usually has at most."""
_IDENTITY = np.eye(3)


class Evaluator:
    """Evaluates with the head's own engine; changed vertices are uploaded. Base class of the other evaluators.

    name : "cpu" or "gpu". reason : why it was chosen.
    """

    name = "cpu"

    def __init__(self, head: ViewHead, reason: str) -> None:
        self._head, self.reason = head, reason

    def pose(self, values: np.ndarray) -> None:
        """Move the head to parameter values (P,)."""
        self._head.pose(values)

    def update(self, parts: Sequence[Any]) -> int:
        """Bring the buffers of `parts` up to date; returns how many vertices changed."""
        return sum(buffers.upload() for buffers in parts)

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        """Positions now of vertices `ids` (k,) of a part, (k, 3)."""
        positions: np.ndarray = part.vertices[ids]
        return positions

    def rotation(self) -> np.ndarray:
        """Rotation of the head, (3, 3)."""
        return np.asarray(getattr(self._head.parts[0], "turn", _IDENTITY))

    @property
    def lips_closed(self) -> bool:
        """Whether lips are known to touch all along their opening, so that they hide teeth and gums."""
        return False

    def release(self) -> None:
        """Release the graphics memory."""


class GpuEvaluator(Evaluator):
    """Evaluates on the graphics processor; control points are uploaded.

    The head's own vertices and normals keep their last values.

    head : a :class:`surface.head.Head`: its surfaces are needed.
    """

    name = "gpu"

    def __init__(self, ctx: moderngl.Context, head: Head, reason: str) -> None:
        from surface.head.posing.influence import Influence  # compiled: loaded when first used
        from surface.head.posing.kernels import place_vertices

        self._own, self.reason, self._place = head, reason, place_vertices
        self._sums = Influence(head)
        starts = self._sums.part_start.tolist()
        self._ranges = {part.name: ends for part, ends in zip(head.parts, pairwise(starts), strict=True)}
        self._vertex_sums = VertexSums(ctx, self._sums)
        self._points = np.zeros((self._sums.points, 4), np.float32)
        self._read: dict[tuple[str, int], tuple[np.ndarray, ...]] = {}
        self._turn: Turn | None = None
        self._changed = True

    def pose(self, values: np.ndarray) -> None:
        placed, turn = self._own.place_points(values)
        points = np.concatenate(placed).astype(np.float32)
        old = self._points[:, :3]
        same = self._turn is not None and np.array_equal(self._turn.matrix, turn.matrix) and np.array_equal(old, points)
        old[:], self._turn = points, turn
        self._changed |= not same

    def update(self, parts: Sequence[Any]) -> int:
        if not self._changed or self._turn is None:
            return 0
        self._changed = False
        self._vertex_sums.update(self._points[:, :3], self._turn)
        for buffers in parts:
            self._vertex_sums.write(buffers.feedback, *self._ranges[buffers.part.name])
        return len(self._sums.share)

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        key = part.name, id(ids)
        if key not in self._read:
            self._read[key] = ids, *self._sums_of(part, ids)  # keeps ids, so that their id stays theirs
        _, start, own, weights, share = self._read[key]
        at = np.empty((len(ids), 3))
        vector, pivot = (np.zeros(3), np.zeros(3)) if self._turn is None else (self._turn.vector, self._turn.pivot)
        self._place(start, own, weights, self._points, share, vector, pivot, at)
        return at

    def _sums_of(self, part: ViewPart, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Start, points and weights of the sums of vertices `ids` of a part before the head turns, and shares."""
        vertices = self._ranges[part.name][0] + np.asarray(ids)
        low, high = self._sums.start[vertices], self._sums.start[vertices + 1]
        entries = np.concatenate([np.zeros(0, np.int64), *map(np.arange, low, high)])
        start = np.concatenate([[0], np.cumsum(high - low)])
        return start, self._sums.ids[entries], self._sums.weights[entries, 0], self._sums.share[vertices]

    def rotation(self) -> np.ndarray:
        return _IDENTITY if self._turn is None else self._turn.matrix

    def release(self) -> None:
        self._vertex_sums.release()


def choose(ctx: moderngl.Context, head: ViewHead, name: str) -> Evaluator:
    """The evaluator called `name`; "auto" takes the graphics processor if there is one that can evaluate.

    Raises ValueError: unknown name. ViewError: "gpu" is asked for and cannot be used.
    """
    if name not in EVALUATORS:
        raise ValueError(f"evaluator must be one of {', '.join(EVALUATORS)}, not {name!r}")
    if name == "cpu":
        return Evaluator(head, "asked for")
    obstacle = why_not_gpu(ctx.info, head)
    if name == "gpu" and obstacle is not None:
        raise ViewError(f"the graphics processor cannot evaluate: {obstacle}", hint="choose evaluator cpu or auto")
    renderer = ctx.info["GL_RENDERER"]
    if name == "auto" and is_software(ctx):
        return Evaluator(head, f"{renderer} draws on the processor")
    if obstacle is not None:
        return Evaluator(head, obstacle)
    reason = "asked for" if name == "gpu" else f"{renderer} is a graphics processor"
    return GpuEvaluator(ctx, head, reason)  # type: ignore[arg-type]


def why_not_gpu(info: Mapping[str, Any], head: ViewHead) -> str | None:
    """Why a head cannot be evaluated on the graphics processor that `info` describes, or None."""
    if not hasattr(head, "place_points"):
        return f"{type(head).__name__} has no control points"
    if info["GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS"] < SAMPLERS:
        return "vertex shaders here read no textures"
    most = -(-sum(len(part.vertices) for part in head.parts) * ENTRIES // WIDTH)
    if info["GL_MAX_TEXTURE_SIZE"] < max(WIDTH, most):
        return f"textures of {info['GL_MAX_TEXTURE_SIZE']} texels are too small for the weights"
    return None
