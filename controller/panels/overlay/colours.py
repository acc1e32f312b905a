"""Colours of the panel: of the layers, of buttons, of states."""

from __future__ import annotations

from typing import Any

Colour = tuple[float, float, float, float]

RED: Colour = (0.75, 0.1, 0.1, 1.0)
GREEN: Colour = (0.1, 0.5, 0.2, 1.0)
BRIGHT_GREEN: Colour = (0.35, 0.8, 0.45, 1.0)
AMBER: Colour = (1.0, 0.72, 0.25, 1.0)
GREY: Colour = (0.6, 0.6, 0.6, 1.0)
LAYERS: dict[str, Colour] = {
    "expression": (0.35, 0.6, 0.95, 1.0),
    "idle": (0.55, 0.6, 0.65, 1.0),
    "gaze": (0.4, 0.8, 0.75, 1.0),
    "speech": (0.75, 0.55, 0.95, 1.0),
    "capture": (0.95, 0.75, 0.3, 1.0),
    "manual": (0.95, 0.45, 0.35, 1.0),
}
OTHER: Colour = (0.8, 0.8, 0.8, 1.0)


def layer_colour(name: str) -> Colour:
    """Return the colour of a layer; a stage's own layers share one."""
    return LAYERS.get(name, OTHER)


def packed(imgui: Any, colour: Colour, alpha: float = 1.0) -> int:
    """Return a colour as ImGui's draw lists take it."""
    return int(imgui.color_convert_float4_to_u32(imgui.ImVec4(*colour[:3], colour[3] * alpha)))
