"""Paint static attributes of vertices in (u, v), such as colours of lips and cheeks, from the layers of head.toml.

A layer of paint names a part, an attribute, a value and a field between 0 and 1 in (u, v):

``band``     along polylines: 1 within ``width`` of any, fading to 0 over ``feather``
``region``   inside closed polygons, fading to 0 over ``feather`` from ``width`` outside on; below 0 it begins inside
``spots``    round ``points``, fading to 0 over ``feather`` from ``width`` on

Layers are applied in order: attribute = attribute + amount * field * (value - attribute).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.base.checks import numbers, require
from surface.base.errors import HeadFileError
from surface.head.model.parameters import smoothstep
from surface.head.posing.kernels import nearest_on_line
from surface.mesh.loops import inside

BASE: dict[str, tuple[float, ...]] = {
    "albedo": (0.60, 0.37, 0.28),
    "occlusion": (1.0,),
    "occlusion_floor": (0.0,),  # baked shade leaves at least this much light
    "gloss": (0.3,),
    "lips": (0.0,),  # 1 on lips, 0.5 at their edge, which quality "full" draws by pixel
    "fold": (0.0, 0.0),  # of the upper lids: how deep, and the platform's height, mm; all over the face
    "iris": (0.080, 0.125, 0.150),  # colours of an eyeball, and the iris's radius in eyeball radii: all over it
    "sclera": (0.68, 0.63, 0.59),
    "iris_radius": (0.49,),
}


KINDS = ("all", "band", "region", "spots")
HINT = "compare it with the other layers of paint"


def paint_part(layers: list[dict[str, Any]], part: str, uv: Floats, where: str) -> dict[str, Floats32]:
    """Return attributes (m, k) of one part at its vertices ``uv (m, 2)``.

    Raises HeadFileError: a layer lacks a key or has a wrong one; names ``where``, the layer and the key.
    """
    out: dict[str, Floats] = {}
    for i, layer in enumerate(layers):
        try:
            if not isinstance(layer, dict):
                raise ValueError("must be a table")
            if layer.get("part") == part:
                _lay_on(out, layer, uv)
        except ValueError as error:
            raise HeadFileError(f"{where}: paint[{i}]: {error}", hint=HINT) from error
    return {k: v.astype(np.float32) for k, v in out.items()}


def _lay_on(out: dict[str, Floats], layer: dict[str, Any], uv: Floats) -> None:
    name = _word(layer, "attribute", tuple(BASE))
    base = np.asarray(BASE[name])
    value = np.atleast_1d(_numbers(layer, "value"))
    if value.shape not in ((1,), base.shape):
        raise ValueError(f"value: must have {len(base)} numbers, not shape {value.shape}")
    if name not in out:
        out[name] = np.tile(base, (len(uv), 1))
    strength = _number(layer, "amount", 1.0) * layer_field(layer, uv)[:, None]
    out[name] += strength * (value - out[name])


def _word(layer: dict[str, Any], key: str, known: tuple[str, ...]) -> str:
    value = layer.get(key)
    if not isinstance(value, str) or value not in known:
        why = "missing" if value is None else f"{value!r:.60} is not one of {', '.join(known)}"
        raise ValueError(f"{key}: {why}")
    return value


def _numbers(layer: dict[str, Any], key: str) -> Floats:
    if key not in layer:
        raise ValueError(f"{key}: missing")
    found = numbers(layer[key], key)
    require(np.atleast_1d(np.isfinite(found)), np.atleast_1d(found), key)
    return found


def _number(layer: dict[str, Any], key: str, default: float | None = None) -> float:
    found = _numbers(layer if default is None else {key: default} | layer, key)
    if found.ndim:
        raise ValueError(f"{key}: must be one number")
    return float(found)


def layer_field(layer: dict[str, Any], uv: Floats) -> Floats:
    """Return (m,): how strongly a layer shows at each vertex."""
    kind = _word(layer, "kind", KINDS)
    if kind == "all":
        return np.ones(len(uv))
    width, feather = _number(layer, "width", 0.0), _number(layer, "feather")
    uv, least = np.ascontiguousarray(uv), np.full(len(uv), np.inf)
    distance, along = np.empty(len(uv)), np.empty(len(uv))
    for line in _lines(layer):
        nearest_on_line(uv, line, kind == "region", distance, along)
        np.minimum(least, distance, out=least)
        if kind == "region":
            within = inside(np.hstack([line, np.roll(line, -1, axis=0)]), uv)
            least[within] = np.minimum(least[within], -distance[within])
    return 1.0 - smoothstep((least - width) / max(feather, 1e-9))


def _lines(layer: dict[str, Any]) -> list[Floats]:
    """Return each (k, 2), k >= 1."""
    lines = layer.get("lines")
    if not isinstance(lines, list) or not lines:
        raise ValueError("lines: must be a list with at least one line of points (u, v)")
    found = [_numbers({f"lines[{i}]": line}, f"lines[{i}]") for i, line in enumerate(lines)]
    for i, line in enumerate(found):
        if line.ndim != 2 or line.shape[1] != 2 or not len(line):
            raise ValueError(f"lines[{i}]: must be a list of points (u, v), not of shape {line.shape}")
    return found
