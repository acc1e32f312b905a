"""Paint static attributes of vertices in (u, v), such as colours of lips and cheeks, from the layers of head.toml.

A layer of paint names a part, an attribute, a value and a field between 0 and 1 in (u, v):

``band``     along polylines: 1 within ``width`` of any, fading to 0 over ``feather``
``region``   inside closed polygons, fading to 0 over ``feather`` outside
``spots``    round ``points``, fading to 0 over ``feather`` from ``width`` on

Layers are applied in order: attribute = attribute + amount * field * (value - attribute).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.parameters import smoothstep
from surface.head.posing.kernels import nearest_on_line
from surface.mesh.loops import inside

BASE: dict[str, tuple[float, ...]] = {
    "albedo": (0.60, 0.37, 0.28),
    "occlusion": (1.0,),
    "occlusion_floor": (0.0,),  # baked shade leaves at least this much light
    "gloss": (0.3,),
    "iris": (0.080, 0.125, 0.150),  # colours of an eyeball, and the iris's radius in eyeball radii: all over it
    "sclera": (0.68, 0.63, 0.59),
    "iris_radius": (0.49,),
}


def paint_part(layers: list[dict[str, Any]], part: str, uv: Floats, where: str) -> dict[str, Floats32]:
    """Attributes (m, k) of one part at its vertices ``uv (m, 2)``.

    Raises HeadFileError: a layer lacks a key or has a wrong one; names ``where`` and the layer.
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
    if not lines:
        raise ValueError("lines is empty")
    uv, least = np.ascontiguousarray(uv), np.full(len(uv), np.inf)
    distance, along = np.empty(len(uv)), np.empty(len(uv))
    for line in lines:
        nearest_on_line(uv, line, kind == "region", distance, along)
        np.minimum(least, distance, out=least)
        if kind == "region":
            least[inside(np.hstack([line, np.roll(line, -1, axis=0)]), uv)] = 0.0
    return 1.0 - smoothstep((least - width) / max(feather, 1e-9))
