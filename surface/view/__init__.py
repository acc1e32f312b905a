"""Pictures of a head, drawn with OpenGL 3.1, off-screen or in a window.

In: a head, poses, a camera and a theme. Out: pixels, image files, a window. Imports base, mesh and head.

Nothing here imports moderngl, Pillow or imgui-bundle before it is used, so a machine without them can still
import the package; what needs one of them raises a :class:`surface.base.errors.ViewError` that names what is missing.
"""

from surface.view.draw.renderer import Renderer
from surface.view.pictures.clip import write_clip
from surface.view.pictures.offscreen import Offscreen
from surface.view.pictures.sheet import compose, contact_sheet, write_png
from surface.view.scene.camera import PRESETS, Camera
from surface.view.scene.theme import THEMES, Light, Theme
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
