"""Sliders of all parameters by region: searchable, both sides linked or apart, with what holds each."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from controller.base.parameters import PARAMETERS, Floats, Parameters, fold
from controller.body.panel_state import PanelState
from controller.panels.overlay.colours import layer_colour, packed
from controller.panels.session.commands import Commands
from controller.panels.session.held_values import HeldValues

_ASIDE = ("mouthLeft", "mouthRight", "jawLeft", "jawRight")
_OTHERS = "expressions, idle motion, speech and live faces"
_TICK = f"tick: hold it by hand, and {_OTHERS} do not move it"
_UNTICK = f"held by hand, or by a command\nuntick: release it, and {_OTHERS} move it again"


class Sliders:
    """Draws the sliders.

    newest : the newest parameters (P,). state : the body's state; without it no holder and no servo is shown.
    parameters : of the stage; those of the base vocabulary without. clock : seconds.
    """

    def __init__(
        self, newest: Callable[[], Floats], commands: Commands, state: PanelState | None = None,
        parameters: Parameters | None = None, clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._parameters = parameters or PARAMETERS
        self._newest, self._commands, self._state = newest, commands, state
        self._search, self._linked = "", True
        self._mirror = self._parameters.mirror()
        self._held = HeldValues(commands, state, clock)

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        imgui.set_next_item_width(-imgui.calc_text_size("both sides").x - 4 * imgui.get_frame_height() / 2)
        _, self._search = imgui.input_text_with_hint("##search", "search", self._search)
        imgui.same_line()
        _, self._linked = imgui.checkbox("both sides", self._linked)
        self._all_held(imgui)
        for region in self._parameters.region_names:
            self._region(imgui, region)

    def rows(self, region: str) -> list[tuple[int, ...]]:
        """Return indices that each slider of a region moves: two where sides are linked."""
        members = [
            i
            for i in map(int, self._parameters.region(region))
            if fold(self._search) in fold(self._parameters.names[i])
        ]
        if not self._linked:
            return [(i,) for i in members]
        pairs = {tuple(sorted({i, int(self._mirror[i])})): None for i in members}
        same = {pair: same_sense(pair, self._parameters) for pair in pairs}
        return [pair for pair in pairs if same[pair]] + [(i,) for pair in pairs if not same[pair] for i in pair]

    def held(self, index: int) -> float | None:
        """The value at which a parameter is held by hand, here or by another panel or link; None where it is not."""
        return self._held.get(index)

    def listen(self) -> None:
        """Hear what is held; called once a frame, also where the sliders are not drawn."""
        self._held.update()

    def _all_held(self, imgui: Any) -> None:
        """How many are held, and a button that releases all of them."""
        held = [i for i in range(len(self._parameters)) if self.held(i) is not None]
        imgui.begin_disabled(not held)
        if imgui.button("release all"):
            self._commands.hold(dict.fromkeys(held))
        imgui.end_disabled()
        imgui.same_line()
        imgui.text_disabled(f"{len(held)} held" if held else "a tick holds a value by hand")

    def _region(self, imgui: Any, region: str) -> None:
        rows = self.rows(region)
        if not rows:
            return
        if self._search:
            imgui.set_next_item_open(True)
        if not imgui.collapsing_header(f"{region}{self._held_in(region)}{self._away(region)}###{region}"):
            return
        names = [_label(row, self._parameters) for row in rows]
        if imgui.begin_table(f"##{region}", 2, imgui.TableFlags_.sizing_stretch_prop):
            width = max(imgui.calc_text_size(name).x for name in names) + imgui.get_frame_height() * 1.4
            imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, width)
            imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch)
            for name, row in zip(names, rows, strict=True):
                self._row(imgui, name, row)
            imgui.end_table()

    def _row(self, imgui: Any, name: str, row: Sequence[int]) -> None:
        """Draw the lock with the name, and the slider."""
        imgui.table_next_row()
        imgui.table_next_column()
        held = all(self.held(i) is not None for i in row)
        values = self._newest()
        locked, held = imgui.checkbox(f"{name}##hold", held)
        if imgui.is_item_hovered():
            about = self._parameters.descriptions.get(self._parameters.names[row[0]], "")
            imgui.set_tooltip((_UNTICK if held else _TICK) + (about and f"\n{about}"))
        if locked:
            self._commands.hold({i: float(values[i]) if held else None for i in row})
        imgui.table_next_column()
        self._slider(imgui, name, row, values)

    def _slider(self, imgui: Any, name: str, row: Sequence[int], values: Floats) -> None:
        low, high = float(self._parameters.low[row[0]]), float(self._parameters.high[row[0]])
        held = [float(values[i]) if (value := self.held(i)) is None else value for i in row]
        holder = "" if self._state is None else self._state.holder(row[0])
        words = f"%.2f  {holder.replace('%', '%%')}" if holder else "%.2f"
        imgui.push_style_color(imgui.Col_.slider_grab, imgui.ImVec4(*layer_colour(holder)))
        imgui.set_next_item_width(-1)
        moved, value = imgui.slider_float(f"##{name}", float(np.mean(held)), low, high, words)
        imgui.pop_style_color()
        self._measured(imgui, row, low, high)
        if moved:
            self._commands.hold(dict.fromkeys(row, float(np.clip(value, low, high))), ("hold", *row))

    def _measured(self, imgui: Any, row: Sequence[int], low: float, high: float) -> None:
        """Draw a mark at the measured value, and the value itself while the mouse points at it."""
        measured = [] if self._state is None else [self._state.measured(i) for i in row]
        known = [x for x in measured if x is not None]
        if not known:
            return
        corner, far = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        x = corner.x + (far.x - corner.x) * float(np.clip((np.mean(known) - low) / (high - low), 0.0, 1.0))
        white = packed(imgui, (1.0, 1.0, 1.0, 1.0))
        imgui.get_window_draw_list().add_line(imgui.ImVec2(x, corner.y), imgui.ImVec2(x, far.y), white, 1.5)
        if imgui.is_item_hovered():
            imgui.set_tooltip("servos show " + " and ".join(f"{x:.2f}" for x in known))

    def _held_in(self, region: str) -> str:
        """How many parameters of a region are held, for its title, which may be closed."""
        count = sum(self.held(int(i)) is not None for i in self._parameters.region(region))
        return f"   {count} held" if count else ""

    def _away(self, region: str) -> str:
        """Return how far the servos of a region are from their wanted angles, for its title."""
        away = None if self._state is None else self._state.away_deg(region)
        return "" if away is None else f"   servos {away:.1f} deg away"


def same_sense(row: Sequence[int], parameters: Parameters) -> bool:
    """Whether one value fits both sides: not what moves the whole mouth or jaw aside, nor the eyes' directions."""
    names = [parameters.names[i] for i in row]
    aside = any("Eye" in name or "Look" in name or name in _ASIDE for name in names)
    return len(set(row)) == 2 and not aside


def _label(row: Sequence[int], parameters: Parameters) -> str:
    name = parameters.names[row[0]]
    return name.removesuffix("Left").removesuffix("Right") if len(row) > 1 else name
