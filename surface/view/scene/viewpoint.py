"""Control of the camera by mouse and keys, without a window library."""

from __future__ import annotations

import numpy as np

from surface.view.scene.camera import PRESETS, Camera
from surface.view.scene.framing import Framing

#: Keys, in order, for the presets.
KEYS = dict(zip("12345", PRESETS, strict=True))
_DEGREES_PER_PIXEL = 0.35
_ZOOM_PER_NOTCH = 1.12


class Viewpoint:
    """The camera of a window; key 0 resets it to the camera given (the front without one).

    framing : of the head that is looked at, for the presets.
    """

    def __init__(self, camera: Camera | None = None, framing: Framing = Framing()) -> None:
        self._framing = framing
        self.home = camera or framing.camera(Camera.front())
        self.camera = self.home

    def reframe(self, framing: Framing) -> None:
        """Look at another head; the view is the front of it."""
        self._framing = framing
        self.home = self.camera = framing.camera(Camera.front())

    def turn(self, right: float, down: float) -> None:
        """Orbit for a drag of so many pixels; the head follows the mouse."""
        self.camera = self.camera.orbit(-right * _DEGREES_PER_PIXEL, down * _DEGREES_PER_PIXEL)

    def shift(self, right: float, down: float, height: int) -> None:
        """Move sideways for a drag of so many pixels in a window of `height` pixels."""
        span = 2.0 * self.camera.distance * np.tan(np.radians(self.camera.fov_deg) / 2.0)
        view = self.camera.view().astype(float)
        step = (-right * view[0, :3] + down * view[1, :3]) * span / max(height, 1)
        target = np.asarray(self.camera.target) + step
        self.camera = self.camera.aimed((float(target[0]), float(target[1]), float(target[2])))

    def zoom(self, notches: float) -> None:
        """Nearer for positive mouse wheel notches."""
        self.camera = self.camera.zoom(_ZOOM_PER_NOTCH**notches)

    def press(self, key: str) -> bool:
        """Apply a key: 1 to 5 are the presets, 0 resets. Returns whether the key has a meaning."""
        if key == "0":
            self.camera = self.home
        elif key in KEYS:
            self.camera = self._framing.camera(PRESETS[KEYS[key]]())
        else:
            return False
        return True
