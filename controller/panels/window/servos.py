"""Servos as bars within their limits, with what they report, and scrolling plots of the chosen ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controller.panels.overlay.colours import AMBER, BRIGHT_GREEN, GREY, LAYERS, packed
from controller.panels.session.feed import KEPT_S, Feed, servo_key

_PLOT_LINES = 11.0
_HOT_C = 60.0
"""Temperature from which on a value is drawn in amber; the limit of a model shows in its own alarm."""


class ServoBars:
    """Draws them.

    feed : the body's reports on servos. below : draws more about the servos that were clicked.
    """

    def __init__(self, feed: Feed, below: Callable[[list[Mapping[str, Any]]], None] = lambda servos: None) -> None:
        self._feed, self._below = feed, below
        self.plotted: list[str] = []

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        details = self._feed.details
        for bus in details.buses:
            self._bus(imgui, bus)
        if not details.servos:
            imgui.text_wrapped("asking the servos" if self._feed.waiting else "this stage has no servos")
            return
        self._plots(imgui, details.servos)
        flags = imgui.TableFlags_.sizing_stretch_prop | imgui.TableFlags_.row_bg
        if imgui.begin_table("##servos", 3, flags):
            self._columns(imgui, [servo["name"] for servo in details.servos])
            for servo in details.servos:
                self._row(imgui, servo)
            imgui.end_table()
        imgui.text_wrapped("bar: limits; mark: wanted; line: measured. Click one to plot and to calibrate it.")
        self._below([servo for servo in details.servos if servo_key(servo) in self.plotted])

    def _columns(self, imgui: Any, names: list[str]) -> None:
        fixed, height = imgui.TableColumnFlags_.width_fixed, imgui.get_font_size()
        imgui.table_setup_column("name", fixed, max(imgui.calc_text_size(name).x for name in names) + height)
        imgui.table_setup_column("bar", imgui.TableColumnFlags_.width_stretch)
        imgui.table_setup_column("state", fixed, imgui.calc_text_size("-000.0 deg  00 C").x)

    def _bus(self, imgui: Any, bus: Mapping[str, Any]) -> None:
        """Draw whether a bus drives its servos, and why not."""
        fault = str(bus["fault"])
        words = fault or ("torque on" if bus["running"] else "torque off")
        colour = AMBER if fault else BRIGHT_GREEN if bus["running"] else GREY
        imgui.text_colored(imgui.ImVec4(*colour), f"bus {bus['name']}: {'' if fault else words}")
        if fault:
            imgui.text_wrapped(fault)

    def _row(self, imgui: Any, servo: Mapping[str, Any]) -> None:
        key = servo_key(servo)
        imgui.table_next_row()
        imgui.table_next_column()
        chosen = key in self.plotted
        if imgui.selectable(f"{servo['name']}##{key}", chosen, imgui.SelectableFlags_.span_all_columns)[0]:
            self.toggle(key)
        if imgui.is_item_hovered():
            imgui.set_tooltip(tooltip(servo))
        imgui.table_next_column()
        self._bar(imgui, servo)
        imgui.table_next_column()
        self._state(imgui, servo)

    def toggle(self, key: str) -> None:
        """Start or stop plotting a servo."""
        if key in self.plotted:
            self.plotted.remove(key)
        else:
            self.plotted.append(key)

    def _bar(self, imgui: Any, servo: Mapping[str, Any]) -> None:
        corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        height, draw = imgui.get_font_size(), imgui.get_window_draw_list()
        far = imgui.ImVec2(corner.x + width, corner.y + height)
        draw.add_rect_filled(corner, far, packed(imgui, (0.5, 0.5, 0.5, 0.25)), 2.0)
        wanted, measured = (share(servo, servo.get(name)) for name in ("wanted_deg", "measured_deg"))
        if wanted is not None:
            x, half = corner.x + wanted * width, height / 4
            low, high = imgui.ImVec2(x - half, corner.y + half), imgui.ImVec2(x + half, far.y - half)
            draw.add_rect_filled(low, high, packed(imgui, LAYERS["expression"]), 2.0)
        if measured is not None:
            x = corner.x + measured * width
            white = packed(imgui, (1.0, 1.0, 1.0, 1.0))
            draw.add_line(imgui.ImVec2(x, corner.y), imgui.ImVec2(x, far.y), white, 2.0)
        imgui.dummy(imgui.ImVec2(width, height))

    def _state(self, imgui: Any, servo: Mapping[str, Any]) -> None:
        error, warm = str(servo.get("error") or ""), servo.get("temperature_c")
        if error:
            imgui.text_colored(imgui.ImVec4(*AMBER), error)
            return
        measured = servo.get("measured_deg")
        imgui.text("" if measured is None else f"{measured:6.1f} deg")
        if warm is not None:
            imgui.same_line()
            words = f"{warm:.0f} C"
            imgui.text_colored(imgui.ImVec4(*AMBER), words) if warm >= _HOT_C else imgui.text_disabled(words)

    def _plots(self, imgui: Any, servos: list[dict[str, Any]]) -> None:
        by_key = {servo_key(servo): servo for servo in servos}
        for key in [key for key in self.plotted if key in by_key]:
            self._plot(imgui, key, by_key[key])

    def _plot(self, imgui: Any, key: str, servo: Mapping[str, Any]) -> None:
        from imgui_bundle import implot  # optional

        if implot.get_current_context() is None:
            implot.create_context()
        times, rows = self._feed.history(servo).series()
        if not len(times):
            return
        ago = np.ascontiguousarray(times - times[-1])
        if implot.begin_plot(f"{servo['name']}##{key}", imgui.ImVec2(-1, imgui.get_font_size() * _PLOT_LINES)):
            implot.setup_axes("s", "deg")
            implot.setup_axis_limits(implot.ImAxis_.x1.value, -KEPT_S, 0.0, implot.Cond_.always.value)
            low, high = float(servo["low_deg"]), float(servo["high_deg"])
            implot.setup_axis_limits(implot.ImAxis_.y1.value, low, high, implot.Cond_.once.value)
            for name, values in zip(("wanted", "measured"), rows, strict=False):
                implot.plot_line(name, ago, np.ascontiguousarray(values))
            implot.end_plot()


def share(servo: Mapping[str, Any], angle_deg: float | None) -> float | None:
    """Return where an angle is between a servo's limits, 0..1; None where it is not known."""
    low, high = float(servo["low_deg"]), float(servo["high_deg"])
    if angle_deg is None or high <= low:
        return None
    return float(np.clip((angle_deg - low) / (high - low), 0.0, 1.0))


def tooltip(servo: Mapping[str, Any]) -> str:
    """Return all that is known of a servo, in lines."""
    lines = [
        f"{servo['name']}: {servo['model']}, id {servo['id']} on {servo['bus']}",
        f"limits {servo['low_deg']:g} to {servo['high_deg']:g} deg, wanted {servo['wanted_deg']:g} deg",
    ]
    units = {"measured_deg": "deg measured", "age_s": "s old", "temperature_c": "C", "voltage_v": "V", "current_a": "A"}
    lines += [f"{servo[key]:g} {unit}" for key, unit in units.items() if servo.get(key) is not None]
    if "torque" in servo:
        lines.append("torque on" if servo["torque"] else "torque off")
    return "\n".join([*lines, *([servo["error"]] if servo.get("error") else [])])
