"""A face as a height field, known at every place: what tests of transfer search, match and measure."""

from __future__ import annotations

import numpy as np

from surface.fit.transfer.scan import Samples
from surface.fit.transfer.template import Template

EYES, RADIUS = np.array([[32.0, 36.0, 62.0], [-32.0, 36.0, 62.0]]), 12.0
HUMPS = (  # height, x (both sides), y, half widths in x and y: nose, brows, lips, the line between them, chin
    (24.0, 0.0, 0.0, 9.0, 14.0), (5.0, 26.0, 54.0, 18.0, 6.0), (5.0, 0.0, -38.0, 22.0, 9.0),
    (-5.0, 0.0, -38.0, 20.0, 2.5), (8.0, 0.0, -72.0, 15.0, 10.0), (-9.0, 33.0, 36.0, 13.0, 9.0),
)  # fmt: skip
PLACES = {
    "nose_tip": (0, 0), "nose_bridge": (0, 36), "chin": (0, -72), "mouth_left": (22, -38), "mouth_right": (-22, -38),
    "upper_lip": (0, -35), "lower_lip": (0, -42),
    "left_eye_inner": (20, 36), "left_eye_outer": (46, 36), "left_eye_upper": (33, 41), "left_eye_lower": (33, 31),
    "right_eye_inner": (-20, 36), "right_eye_outer": (-46, 36), "right_eye_upper": (-33, 41),
    "right_eye_lower": (-33, 31),
}  # fmt: skip


def depth(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """z of the face at places x, y, mm."""
    z = 80.0 - 0.008 * x**2 - 0.002 * y**2
    for height, hx, hy, wide, tall in HUMPS:
        z = z + height * np.exp(-(((np.abs(x) - hx) / wide) ** 2) - ((y - hy) / tall) ** 2)
    return z


def on_face(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) of the face and its unit normals there, by differences."""
    x, y, step = np.asarray(x, float), np.asarray(y, float), 1e-4
    dx, dy = (depth(x + step, y) - depth(x - step, y)), (depth(x, y + step) - depth(x, y - step))
    normal = np.column_stack([-dx / (2 * step), -dy / (2 * step), np.ones_like(x)])
    return np.column_stack([x, y, depth(x, y)]), normal / np.linalg.norm(normal, axis=1, keepdims=True)


def template(step: float = 4.0) -> Template:
    """The face as a template; both eyeballs' fronts are patches of it."""
    xs, ys = np.arange(-70.0, 70.0 + step / 2, step), np.arange(-100.0, 100.0 + step / 2, step)
    x, y = (a.ravel() for a in np.meshgrid(xs, ys, indexing="ij"))
    points, normals = on_face(x, y)
    at = np.arange(len(points)).reshape(len(xs), len(ys))
    a, b, c, d = (k.ravel() for k in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    eye = np.full(len(points), -1)
    for side, sign in enumerate((1.0, -1.0)):
        eye[((sign * x - 33) / 11) ** 2 + ((y - 36) / 5) ** 2 < 1.0] = side
    marks = dict(zip(PLACES, on_face(*np.array(list(PLACES.values()), float).T)[0], strict=True))
    return Template(points, normals, triangles, eye < 0, eye, marks, EYES.copy(), RADIUS)


def samples(count: int = 3000, seed: int = 3) -> Samples:
    """Random places of the face with normals; none is at a border."""
    rng = np.random.default_rng(seed)
    points, normals = on_face(rng.uniform(-70, 70, count), rng.uniform(-100, 100, count))
    return Samples(points, normals, np.zeros(count, bool))
