"""The picture: a head drawn with OpenGL 3.1, off-screen or in a window.

Nothing here imports moderngl, Pillow or imgui-bundle before it is used, so a machine without them can still
import the package; what needs one of them raises a :class:`surface.errors.ViewError` that says so.
"""

from surface.view.camera import PRESETS, Camera
from surface.view.clip import write_clip
from surface.view.offscreen import Offscreen
from surface.view.renderer import Renderer
from surface.view.sheet import compose, contact_sheet, write_png
from surface.view.theme import THEMES, Light, Theme
from surface.view.window import run_window

__all__ = [
    "PRESETS",
    "THEMES",
    "Camera",
    "Light",
    "Offscreen",
    "Renderer",
    "Theme",
    "compose",
    "contact_sheet",
    "run_window",
    "write_clip",
    "write_png",
]
