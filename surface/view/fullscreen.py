"""A window that covers its whole screen, and goes back to where it was."""

from __future__ import annotations

from typing import Any


class FullScreen:
    """Switches the window of ImGui's runner; does nothing where the runner has no window of GLFW.

    on : whether it covers its screen.
    """

    def __init__(self) -> None:
        self.on = False
        self._before = (0, 0, 1280, 720)

    def toggle(self) -> None:
        """Cover the screen, or go back."""
        window, glfw = glfw_window()
        if window is None:
            return
        if self.on:
            left, top, width, height = self._before
            glfw.set_window_monitor(window, None, left, top, width, height, 0)
        else:
            self._before = (*glfw.get_window_pos(window), *glfw.get_window_size(window))
            monitor = _nearest(glfw, self._before)
            mode = glfw.get_video_mode(monitor)
            glfw.set_window_monitor(window, monitor, 0, 0, mode.size.width, mode.size.height, mode.refresh_rate)
        self.on = not self.on


def glfw_window() -> tuple[Any, Any]:
    """The runner's window and the module GLFW; None twice where there is none."""
    try:
        import glfw  # optional, and after imgui_bundle, whose library it then uses
        from imgui_bundle import glfw_utils  # optional: the extra view

        return glfw_utils.glfw_window_hello_imgui(), glfw
    except Exception:  # noqa: BLE001  another backend, or no window: what needs one is then left out
        return None, None


def desktop_scale() -> float:
    """The desktop's factor on sizes under X11, before there is a window that reports it; 1 elsewhere."""
    try:
        import glfw  # optional, and after imgui_bundle, whose library it then uses

        if not glfw.init() or glfw.get_platform() != glfw.PLATFORM_X11:
            return 1.0
        scale = glfw.get_monitor_content_scale(glfw.get_primary_monitor())
        return max(float(scale[0]), 1.0)
    except Exception:  # noqa: BLE001  no GLFW, or no monitor: text is as large as without
        return 1.0


def opened_size(size: tuple[float, float], desktop: float) -> tuple[float, float]:
    """The size of a window that was asked for in ``size`` points: the runner makes it larger by the desktop's factor,
    but no larger than the monitor."""
    try:
        import glfw  # optional, and after imgui_bundle, whose library it then uses

        monitor = glfw.get_video_mode(glfw.get_primary_monitor()).size if desktop > 1.0 else size
    except Exception:  # noqa: BLE001  no GLFW, or no monitor: as large as it was asked for
        monitor = size
    return min(size[0] * desktop, max(monitor[0], 1)), min(size[1] * desktop, max(monitor[1], 1))


def _nearest(glfw: Any, window: tuple[int, int, int, int]) -> Any:
    """The monitor that holds most of a window."""
    left, top, width, height = window

    def shared(monitor: Any) -> int:
        x, y = glfw.get_monitor_pos(monitor)
        size = glfw.get_video_mode(monitor).size
        across = min(left + width, x + size.width) - max(left, x)
        down = min(top + height, y + size.height) - max(top, y)
        return int(max(across, 0) * max(down, 0))

    return max(glfw.get_monitors(), key=shared)
