"""How much sky each vertex sees: depth pictures from many directions, for the shade in sockets, nostrils and folds.

Done once when a head is made and kept in its file; the picture then shades crevices at no cost per frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.head import Head, load_data
from surface.head.posing.baked import shade_path, write_shade
from surface.view.draw.programs import build, put
from surface.view.pictures.offscreen import open_context
from surface.view.scene.parts import ViewHead, ViewPart

if TYPE_CHECKING:
    import moderngl

#: What hides the sky from what: skin and eyes are shaded by each other, the mouth's inside by itself alone,
#: since the light that comes in between the lips is worked out each frame.
_COMPANIES = (("skin", "eye"), ("teeth", "gums", "tongue"))

#: Coefficients of the sky lie between minus and plus this.
SKY_RANGE = 2.0
#: Skin whose other side is further away lets no light through, mm.
_THICK_MM = 11.0
_NEIGHBOURS = 220

#: Pose in which mouth and lids show what they hide at rest.
_OPEN = {"jawOpen": 0.45, "eyeBlinkLeft": 0.8, "eyeBlinkRight": 0.8}


def bake(
    parts: Sequence[ViewPart], *, directions: int = 96, resolution: int = 512, bias_mm: float = 1.2
) -> dict[str, np.ndarray]:
    """Cosine-weighted share of the surroundings that each vertex sees, as the parts stand now.

    Parameters
    ----------
    directions : how many views from all round.
    resolution : pixels along the side of each depth picture.
    bias_mm : how far behind the depth picture a vertex still counts as seen.

    Returns
    -------
    Part name -> (m, 1) float32, 1 = open, 0 = buried; parts of other materials are 1 throughout.

    Raises
    ------
    ViewError : no OpenGL on this machine.
    """
    return {name: seen[:, :1] for name, seen in _bake_all(parts, directions, resolution, bias_mm).items()}


def bake_head(head: ViewHead, open_pose: np.ndarray, **options: Any) -> dict[str, np.ndarray]:
    """The greater of what vertices see at rest and in `open_pose` (P,), so that what opens does not stay black, calmed.

    `open_pose` has the mouth open and the eyes shut; the head is left at rest. Options as for :func:`bake`.
    Skin also gets which way the sky lies, by "NAME/visible" (see :func:`fit_sky`), and how thin it is, by
    "NAME/thin".
    """
    head.pose(np.asarray(open_pose, np.float64))
    opened = _bake_all(head.parts, **options)
    head.pose(np.zeros(len(head.parameters)))
    rest = _bake_all(head.parts, **options)
    result: dict[str, np.ndarray] = {}
    for part in head.parts:
        shut, wide = rest[part.name], opened[part.name]
        best = calm(np.where(wide[:, :1] > shut[:, :1], wide, shut), part.triangles)
        result[part.name] = best[:, :1]
        if part.material == "skin":
            result[f"{part.name}/visible"] = best[:, 1:] / (2.0 * SKY_RANGE) + 0.5
            result[f"{part.name}/thin"] = thinness(part)
    return result


def calm(values: np.ndarray, triangles: np.ndarray, passes: int = 2) -> np.ndarray:
    """Values (m, k) of vertices half way to the mean of their neighbours, `passes` times over.

    Views are few, and what neighbours differ by for that reason shows as streaks where skin stretches.
    """
    from scipy.sparse import coo_array  # takes a moment to import

    start, end = np.asarray(triangles).T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    ones = np.ones(2 * len(start), np.float32)
    joined = coo_array((ones, (np.append(start, end), np.append(end, start))), shape=(len(values),) * 2).tocsr()
    count = np.maximum(joined.sum(axis=1), 1e-9)[:, None]
    alone = (count < 1.0)[:, 0]
    result = np.asarray(values, np.float32)
    for _ in range(passes):
        result = np.where(alone[:, None], result, 0.5 * result + 0.5 * (joined @ result) / count)
    return result


def thinness(part: ViewPart) -> np.ndarray:
    """How near the skin's other side lies, (m, 1): 1 touches, 0 is further than `_THICK_MM`."""
    from scipy.spatial import cKDTree

    vertices, normals = np.asarray(part.vertices, float), np.asarray(part.normals, float)
    distance, near = cKDTree(vertices).query(
        vertices, k=min(_NEIGHBOURS, len(vertices)), distance_upper_bound=_THICK_MM
    )
    there = np.append(vertices, [[0.0, 0.0, 0.0]], axis=0)[near] - vertices[:, None]
    away = np.append(normals, [[0.0, 0.0, 0.0]], axis=0)[near]
    facing = (away * normals[:, None]).sum(axis=2) < -0.4
    inside = (there * normals[:, None]).sum(axis=2) < -0.5 * distance
    depth = np.where(facing & inside, distance, _THICK_MM).min(axis=1)
    thin: np.ndarray = (1.0 - depth[:, None] / _THICK_MM).astype(np.float32)
    return thin


def _bake_all(
    parts: Sequence[ViewPart], directions: int = 96, resolution: int = 512, bias_mm: float = 1.2
) -> dict[str, np.ndarray]:
    """Part name -> (m, 5): the share of the surroundings seen, and the sky of :func:`fit_sky`."""
    result = {part.name: np.tile(np.array([1, 1, 0, 0, 0], np.float32), (len(part.vertices), 1)) for part in parts}
    ctx = open_context()
    try:
        for company in _COMPANIES:
            members = [part for part in parts if part.material in company]
            if members:
                result |= _bake(ctx, members, directions, resolution, bias_mm)
    finally:
        ctx.release()
    return result


def fit_sky(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Coefficients (m, 4) so that a + (b, c, d) . direction is nearest to what a vertex sees there.

    Parameters
    ----------
    normal : (m, 4, 4) sum over directions of weight times the products of (1, direction) with itself.
    right : (m, 4) sum of weight times seen times (1, direction).
    """
    steady = normal + 0.02 * np.eye(4) * np.maximum(normal[:, :1, :1], 1e-6)
    return np.clip(np.linalg.solve(steady, right[..., None])[..., 0], -SKY_RANGE, SKY_RANGE)


def _bake(
    ctx: moderngl.Context, parts: Sequence[ViewPart], directions: int, resolution: int, bias_mm: float
) -> dict[str, np.ndarray]:
    """As :func:`_bake_all` for parts that shade each other."""
    points = np.concatenate([np.asarray(part.vertices, np.float64) for part in parts])
    normals = np.concatenate([np.asarray(part.normals, np.float64) for part in parts])
    program = build(ctx, ("depth.vert",), ("depth.frag",))
    arrays = _arrays(ctx, program, parts)
    depth = ctx.depth_texture((resolution, resolution))
    target = ctx.framebuffer([], depth)
    seen, total = np.zeros(len(points)), np.zeros(len(points))
    normal, right = np.zeros((len(points), 4, 4)), np.zeros((len(points), 4))
    for direction in spread(directions):
        weight = np.clip(normals @ direction, 0.0, None)
        box, matrix, span = orthographic(points, direction)
        put(program, {"view_projection": matrix})
        _draw_depth(ctx, target, arrays)
        picture = np.frombuffer(depth.read(), np.float32).reshape(resolution, resolution)
        visible = lit(box, picture, bias_mm / span)
        seen += weight * visible
        total += weight
        one = np.append(1.0, direction)
        normal += weight[:, None, None] * np.outer(one, one)
        right += (weight * visible)[:, None] * one
    share = np.column_stack([seen / np.maximum(total, 1e-9), fit_sky(normal, right)]).astype(np.float32)
    ends = np.cumsum([len(part.vertices) for part in parts])[:-1]
    return dict(zip([part.name for part in parts], np.split(share, ends), strict=True))


def spread(count: int) -> np.ndarray:
    """`count` directions (count, 3) spread evenly over the sphere (golden spiral)."""
    index = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * index / count, np.pi * (1.0 + 5.0**0.5) * index
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(angle), height, ring * np.sin(angle)])


def orthographic(points: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """View of `points` (m, 3) from far away along `direction` (3,).

    Returns
    -------
    Their place in the unit cube (m, 3), depth last and growing away from the viewer; the matrix (4, 4) to
    clip space; and the depth of the cube in mm.
    """
    side = np.cross(direction, (0.0, 1.0, 0.0) if abs(direction[1]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    frame = np.array([side, np.cross(direction, side), -direction])
    own = points @ frame.T
    low, size = own.min(axis=0), np.maximum(np.ptp(own, axis=0), 1e-6)
    low, size = low - 0.02 * size, 1.04 * size
    matrix = np.eye(4)
    matrix[:3, :3] = 2.0 * frame / size[:, None]
    matrix[:3, 3] = -2.0 * low / size - 1.0
    return (own - low) / size, matrix, float(size[2])


def lit(box: np.ndarray, picture: np.ndarray, bias: float) -> np.ndarray:
    """Whether each place (m, 3) in the unit cube lies before the depth `picture` (r, r); 0..1 over 4 pixels."""
    size = picture.shape[0]
    at = box[:, :2] * size - 0.5
    corner = np.clip(np.floor(at).astype(int), 0, size - 2)
    rest = np.clip(at - corner, 0.0, 1.0)
    result = np.zeros(len(box))
    for dx in (0, 1):
        for dy in (0, 1):
            share = (rest[:, 0] if dx else 1.0 - rest[:, 0]) * (rest[:, 1] if dy else 1.0 - rest[:, 1])
            result += share * (box[:, 2] <= picture[corner[:, 1] + dy, corner[:, 0] + dx] + bias)
    return result


def _arrays(ctx: moderngl.Context, program: moderngl.Program, parts: Sequence[ViewPart]) -> list[moderngl.VertexArray]:
    """Positions and triangles of the parts."""
    made = []
    for part in parts:
        positions = ctx.buffer(np.ascontiguousarray(part.vertices, np.float32).tobytes())
        index = ctx.buffer(np.ascontiguousarray(part.triangles, np.int32).tobytes())
        made.append(ctx.vertex_array(program, [(positions, "3f", "position")], index, 4))
    return made


def _draw_depth(ctx: moderngl.Context, target: moderngl.Framebuffer, arrays: list[moderngl.VertexArray]) -> None:
    """The parts' depth as seen by the program's matrix."""
    target.use()
    ctx.enable_only(ctx.DEPTH_TEST)
    target.clear(depth=1.0)
    for array in arrays:
        array.render()


def shade_head(folder: str | Path) -> Path:
    """Bake the head in `folder` and keep the result beside it; returns the file written.

    Raises
    ------
    HeadFileError : the head cannot be read.
    ViewError : no OpenGL on this machine.
    """
    shade_path(folder).unlink(missing_ok=True)
    head = Head(load_data(folder), str(folder))  # without what stands beside it and is made for another, perhaps
    open_pose = np.array([_OPEN.get(name, 0.0) for name in head.parameters])
    return write_shade(folder, bake_head(head, open_pose), head.parts)
