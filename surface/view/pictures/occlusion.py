"""Baked ambient occlusion: how much sky each vertex sees, from depth pictures from many directions.

Done once when a head is made and kept in its file; the picture then shades sockets, nostrils and folds at no cost per
frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.extras import require
from surface.head import Head, load_data
from surface.head.model.accessories import Accessory, read_accessories
from surface.head.posing.baked import shade_path, write_shade
from surface.head.posing.dressing import WornMesh
from surface.view.draw.programs import build, set_uniforms
from surface.view.pictures.offscreen import open_context
from surface.view.scene.parts import ViewHead, ViewPart

if TYPE_CHECKING:
    import moderngl

#: Materials that occlude each other: the mouth's inside is occluded by itself alone, since the light that enters
#: between the lips is computed each frame.
_OCCLUDERS = (("skin", "eye"), ("teeth", "gums", "tongue"))
#: Kinds of accessories that shade the skin below them.
_SHADING = ("hair", "hat")
#: How much of the light below them they take: some comes through hair, and is reflected by it.
_WORN_SHADE = 0.75
#: Inside the mouth a vertex counts as seen at most so far behind the depth picture: gaps between teeth are narrow.
_INNER_BIAS_MM = 0.35
#: Coefficients of the sky lie between minus and plus this.
SKY_RANGE = 2.0
#: Skin whose other side is further away lets no light through, mm.
_THICK_MM = 11.0
_NEIGHBOURS = 220
_NOTHING = np.zeros((0, 3))
#: Pose in which mouth and lids show what they hide at rest.
OPEN = {"jawOpen": 0.45, "eyeBlinkLeft": 0.8, "eyeBlinkRight": 0.8}


def bake_head(head: ViewHead, open_pose: np.ndarray, **options: Any) -> dict[str, np.ndarray]:
    """Occlusion by part name, (m, 1): the greater of what vertices see at rest and in `open_pose` (P,), smoothed.

    `open_pose` has the mouth open and the eyes shut, so that parts that it uncovers do not stay black; the head is
    left at rest. Options as for :func:`bake`. Skin also gets the direction of the sky, by "NAME/visible" (see
    :func:`fit_sky`), and its thinness, by "NAME/thin".
    """
    options = {"worn": _shading(head), **options}
    head.pose(np.asarray(open_pose, np.float64))
    opened = bake(head.parts, **options)
    head.pose(np.zeros(len(head.parameters)))
    rest = bake(head.parts, **options)
    result: dict[str, np.ndarray] = {}
    for part in head.parts:
        shut, wide = rest[part.name], opened[part.name]
        best = smoothed(np.where(wide[:, :1] > shut[:, :1], wide, shut), part.triangles)
        result[part.name] = best[:, :1]
        if part.material == "skin":
            result[f"{part.name}/visible"] = best[:, 1:] / (2.0 * SKY_RANGE) + 0.5
            result[f"{part.name}/thin"] = thinness(part)
    return result


def _shading(head: ViewHead) -> list[Accessory]:
    """The accessories that shade a face: hair and hats that one does not see through."""
    every = [one.accessory for one in getattr(head, "accessories", ())]
    return [one for one in every if one.kind in _SHADING and one.alpha != "BLEND"]


def smoothed(values: np.ndarray, triangles: np.ndarray, passes: int = 2) -> np.ndarray:
    """Values (m, k) of vertices moved half way to the mean of their neighbours, `passes` times.

    The directions are few, and the noise this causes between neighbours shows as streaks where skin stretches.
    """
    require("baked shade", "scipy")
    from scipy.sparse import coo_array  # takes a moment to import

    start, end = np.asarray(triangles).T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    ones = np.ones(2 * len(start), np.float32)
    joined = coo_array((ones, (np.append(start, end), np.append(end, start))), shape=(len(values),) * 2).tocsr()
    count = joined.sum(axis=1)[:, None]
    result = np.asarray(values, np.float32)
    for _ in range(passes):
        result = np.where(count < 1.0, result, 0.5 * result + 0.5 * (joined @ result) / np.maximum(count, 1e-9))
    return result


def thinness(part: ViewPart) -> np.ndarray:
    """How near the skin's other side lies, (m, 1): 1 touches, 0 is further than `_THICK_MM`."""
    require("baked shade", "scipy")
    from scipy.spatial import cKDTree

    vertices, normals = np.asarray(part.vertices, float), np.asarray(part.normals, float)
    count = min(_NEIGHBOURS, len(vertices))
    distance, near = cKDTree(vertices).query(vertices, k=count, distance_upper_bound=_THICK_MM)
    none = np.zeros((1, 3))  # the row of a neighbour that was not found
    offset = np.append(vertices, none, axis=0)[near] - vertices[:, None]
    opposite = (np.append(normals, none, axis=0)[near] * normals[:, None]).sum(axis=2) < -0.4
    inside = (offset * normals[:, None]).sum(axis=2) < -0.5 * distance
    depth = np.where(opposite & inside, distance, _THICK_MM).min(axis=1)
    thin: np.ndarray = (1.0 - depth[:, None] / _THICK_MM).astype(np.float32)
    return thin


def bake(
    parts: Sequence[ViewPart], *, directions: int = 96, resolution: int = 512, bias_mm: float = 1.2,
    worn: Sequence[Accessory] = (),
) -> dict[str, np.ndarray]:  # fmt: skip
    """Cosine-weighted share of the sky that each vertex sees, as the parts are posed now.

    directions : number of views from all around.
    resolution : pixels along the side of each depth picture.
    bias_mm : how far behind the depth picture a vertex still counts as seen; at most :data:`_INNER_BIAS_MM` inside the
        mouth.
    worn : what shades the skin, too, as if nothing of it were clear.

    Returns part name -> (m, 5) float32: the share, 1 = open, 0 = buried, and the coefficients of :func:`fit_sky`; parts
    of other materials have 1, 1, 0, 0, 0 throughout.

    Raises ViewError: no OpenGL on this machine.
    """
    result = {part.name: np.tile(np.array([1, 1, 0, 0, 0], np.float32), (len(part.vertices), 1)) for part in parts}
    ctx = open_context()
    try:
        for materials in _OCCLUDERS:
            members = [part for part in parts if part.material in materials]
            if members:
                outside = "skin" in materials
                bias, over = (bias_mm, worn) if outside else (min(bias_mm, _INNER_BIAS_MM), ())
                result |= _bake(ctx, members, directions, resolution, bias, over)
    finally:
        ctx.release()
    return result


def fit_sky(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Coefficients (m, 4) so that a + (b, c, d) . direction is nearest to what a vertex sees there (least squares).

    normal : (m, 4, 4) sum over directions of weight times the products of (1, direction) with itself.
    right : (m, 4) sum of weight times seen times (1, direction).
    """
    regular = normal + 0.02 * np.eye(4) * np.maximum(normal[:, :1, :1], 1e-6)
    return np.clip(np.linalg.solve(regular, right[..., None])[..., 0], -SKY_RANGE, SKY_RANGE)


def _bake(
    ctx: moderngl.Context, parts: Sequence[ViewPart], directions: int, resolution: int, bias_mm: float,
    worn: Sequence[Accessory] = (),
) -> dict[str, np.ndarray]:  # fmt: skip
    """As :func:`bake`, for parts that occlude each other."""
    points = np.concatenate([np.asarray(part.vertices, np.float64) for part in parts])
    normals = np.concatenate([np.asarray(part.normals, np.float64) for part in parts])
    program = build(ctx, ("depth.vert",), ("depth.frag",))
    arrays, over = ([_vertex_array(ctx, program, part) for part in each] for each in (parts, worn))
    around = np.concatenate([np.zeros((0, 3)), *(one.vertices for one in worn)])
    depth = ctx.depth_texture((resolution, resolution))
    target = ctx.framebuffer([], depth)
    seen, total = np.zeros(len(points)), np.zeros(len(points))
    normal, right = np.zeros((len(points), 4, 4)), np.zeros((len(points), 4))
    for direction in sphere_directions(directions):
        weight = np.clip(normals @ direction, 0.0, None)
        box, matrix, span = orthographic(points, direction, around)
        set_uniforms(program, {"view_projection": matrix})
        target.use()
        ctx.enable_only(ctx.DEPTH_TEST)
        target.clear(depth=1.0)
        visible = _drawn_visibility(arrays, depth, box, bias_mm / span)
        if over:
            shaded = _drawn_visibility(over, depth, box, bias_mm / span)
            visible += _WORN_SHADE * (shaded - visible)
        seen += weight * visible
        total += weight
        one = np.append(1.0, direction)
        normal += weight[:, None, None] * np.outer(one, one)
        right += (weight * visible)[:, None] * one
    share = np.column_stack([seen / np.maximum(total, 1e-9), fit_sky(normal, right)]).astype(np.float32)
    ends = np.cumsum([len(part.vertices) for part in parts])[:-1]
    return dict(zip([part.name for part in parts], np.split(share, ends), strict=True))


def _drawn_visibility(
    arrays: Sequence[moderngl.VertexArray], depth: moderngl.Texture, box: np.ndarray, bias: float
) -> np.ndarray:
    """As :func:`visibility`, in the depth picture with these arrays drawn into it, too."""
    for array in arrays:
        array.render()
    picture = np.frombuffer(depth.read(), np.float32).reshape(depth.height, depth.width)
    return visibility(box, picture, bias)


def _vertex_array(ctx: moderngl.Context, program: moderngl.Program, part: ViewPart | Accessory) -> moderngl.VertexArray:
    """Positions and triangles of a part."""
    positions = ctx.buffer(np.ascontiguousarray(part.vertices, np.float32).tobytes())
    index = ctx.buffer(np.ascontiguousarray(part.triangles, np.int32).tobytes())
    return ctx.vertex_array(program, [(positions, "3f", "position")], index, 4)


def sphere_directions(count: int) -> np.ndarray:
    """`count` unit vectors (count, 3) evenly over the sphere (golden spiral)."""
    index = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * index / count, np.pi * (1.0 + 5.0**0.5) * index
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(angle), height, ring * np.sin(angle)])


def orthographic(
    points: np.ndarray, direction: np.ndarray, around: np.ndarray = _NOTHING
) -> tuple[np.ndarray, np.ndarray, float]:
    """View of `points` (m, 3) from far away along `direction` (3,).

    around : (k, 3) what may hide them. The cube begins before it, but is no wider for it: what lies beside `points`
    hides nothing, and a wider picture would be coarser.

    Returns their coordinates in the unit cube (m, 3), depth last and growing away from the viewer; the matrix (4, 4) to
    clip space; and the depth of the cube in mm.
    """
    side = np.cross(direction, (0.0, 1.0, 0.0) if abs(direction[1]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    frame = np.array([side, np.cross(direction, side), -direction])
    own = points @ frame.T
    low, high = own.min(axis=0), own.max(axis=0)
    low[2] = (around @ frame[2]).min(initial=low[2])
    size = np.maximum(high - low, 1e-6)
    low, size = low - 0.02 * size, 1.04 * size
    matrix = np.eye(4)
    matrix[:3, :3] = 2.0 * frame / size[:, None]
    matrix[:3, 3] = -2.0 * low / size - 1.0
    return (own - low) / size, matrix, float(size[2])


def visibility(box: np.ndarray, picture: np.ndarray, bias: float) -> np.ndarray:
    """Whether each of `box` (m, 3) in the unit cube lies before the depth `picture` (r, r); 0..1 over 4 pixels."""
    size = picture.shape[0]
    at = box[:, :2] * size - 0.5
    corner = np.clip(np.floor(at).astype(int), 0, size - 2)
    rest = np.clip(at - corner, 0.0, 1.0)
    result = np.zeros(len(box))
    for dx, x_share in enumerate((1.0 - rest[:, 0], rest[:, 0])):
        for dy, y_share in enumerate((1.0 - rest[:, 1], rest[:, 1])):
            before = box[:, 2] <= picture[corner[:, 1] + dy, corner[:, 0] + dx] + bias
            result += x_share * y_share * before
    return result


def shade_head(folder: str | Path) -> Path:
    """Bake the head in `folder` and keep the result beside it; returns the file written.

    Raises HeadFileError: the head cannot be read. ViewError: no OpenGL on this machine.
    """
    shade_path(folder).unlink(missing_ok=True)
    head = Head(load_data(folder), str(folder))  # without the files beside it, which may belong to another head
    head.accessories = tuple(WornMesh(one, head.data.neck) for one in read_accessories(folder))
    open_pose = np.array([OPEN.get(name, 0.0) for name in head.parameters])
    return write_shade(folder, bake_head(head, open_pose), head.parts)
