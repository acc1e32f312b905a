"""Paint static attributes of vertices in (u, v), such as colours of lips and cheeks, from the layers of head.toml.

A layer of paint names a part, an attribute, a value and a field between 0 and 1 in (u, v):

``band``     along polylines: 1 within ``width`` of any, fading to 0 over ``feather``
``region``   inside closed polygons, fading to 0 over ``feather`` outside
``spots``    round ``points``, fading to 0 over ``feather`` from ``width`` on

Layers are laid on in order: attribute = attribute + amount * field * (value - attribute).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.parameters import smoothstep
from surface.head.posing.kernels import nearest_on_line

BASE: dict[str, tuple[float, ...]] = {
    "albedo": (0.60, 0.37, 0.28),
    "occlusion": (1.0,),
    "occlusion_floor": (0.0,),  # baked shade leaves at least this much light
    "gloss": (0.3,),
}


def paint_part(layers: list[dict[str, Any]], part: str, uv: Floats, where: str) -> dict[str, Floats32]:
    """Attributes (m, k) of one part at its vertices ``uv (m, 2)``.

    Raises
    ------
    HeadFileError : a layer lacks a key or has a wrong one; names ``where`` and the layer.
    """
    out: dict[str, Floats] = {}
    for i, layer in enumerate(layers):
        if layer.get("part") != part:
            continue
        try:
            _lay_on(out, layer, uv)
        except (KeyError, ValueError, TypeError, IndexError) as e:
            raise HeadFileError(
                f"{where}: paint[{i}]: {type(e).__name__}: {e}", hint="compare with the other layers"
            ) from e
    return {k: v.astype(np.float32) for k, v in out.items()}


def _lay_on(out: dict[str, Floats], layer: dict[str, Any], uv: Floats) -> None:
    name, value = layer["attribute"], np.atleast_1d(np.asarray(layer["value"], float))
    if name not in out:
        out[name] = np.tile(np.asarray(BASE[name]), (len(uv), 1))
    strength = float(layer.get("amount", 1.0)) * _field(layer, uv)[:, None]
    out[name] += strength * (value - out[name])


def _field(layer: dict[str, Any], uv: Floats) -> Floats:
    kind = layer["kind"]
    if kind == "all":
        return np.ones(len(uv))
    lines = [np.asarray(line, float).reshape(-1, 2) for line in layer["lines"]]
    width, feather = float(layer.get("width", 0.0)), float(layer["feather"])
    if kind not in ("band", "region", "spots"):
        raise ValueError(f"kind {kind!r} is not one of all, band, region, spots")
    closed = kind == "region"
    distance = np.min([_distance(uv, line, closed) for line in lines], axis=0)
    if closed:
        inside = np.any([_inside(uv, line) for line in lines], axis=0)
        distance = np.where(inside, 0.0, distance)
    return 1.0 - smoothstep((distance - width) / max(feather, 1e-9))


def _distance(uv: Floats, line: Floats, closed: bool) -> Floats:
    """Distance (m,) of points from a polyline; a single point counts as one."""
    distance, at = np.empty(len(uv)), np.empty(len(uv))
    nearest_on_line(np.ascontiguousarray(uv), np.ascontiguousarray(line), closed, distance, at)
    return distance


def _inside(uv: Floats, ring: Floats) -> Bools:
    """Even-odd rule."""
    odd = np.zeros(len(uv), bool)
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        crosses = (a[1] > uv[:, 1]) != (b[1] > uv[:, 1])
        height = b[1] - a[1] if b[1] != a[1] else 1e-18
        odd ^= crosses & (uv[:, 0] < a[0] + (uv[:, 1] - a[1]) / height * (b[0] - a[0]))
    return odd
