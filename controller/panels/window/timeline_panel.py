"""Draws the timeline: a scale with the line, keys, marks and the marked range, and the buttons that edit them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from controller.base.errors import OMOTE_ERRORS, ParameterError
from controller.panels.overlay.colours import AMBER, GREY, LAYERS, RED, packed
from controller.panels.session.capture import Capture
from controller.panels.session.commands import Commands
from controller.panels.session.playback import Playback
from controller.panels.session.problems import Problems
from controller.panels.window.flow import Flow
from controller.takes.timeline import EASES
from controller.vocabulary.vocabulary import Vocabulary

_LOADED = (".toml", ".csv", ".wav")
_TRACK_LINES, _NEAR = 3.2, 0.45
_KEY_LINES = 0.35  # half the width of a key, in heights of a line of text
_LABEL = 2.0  # distance from a tick to its label, points
_TICK_LINES = 3.0  # minimum distance of two ticks, in heights of a line of text


class TimelinePanel:
    """Draws it.

    folder : shows and takes are saved there. vocabulary : of the stage.
    """

    def __init__(
        self, playback: Playback, commands: Commands, capture: Capture, vocabulary: Vocabulary, problems: Problems,
        folder: Path,
    ) -> None:  # fmt: skip
        self.playback, self._commands, self._capture = playback, commands, capture
        self._vocabulary, self._problems, self._folder = vocabulary, problems, folder
        self._name, self._mark, self._ease, self._loop, self._message = "my_show", "", 1, False, ""
        self._sound = ""
        self._dragged: int | None = None

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        self._controls(imgui)
        self._track(imgui)
        if self._commands.now.take is not None:
            self._take_buttons(imgui)
        else:
            self._key_buttons(imgui)
        self._saving(imgui)

    def _try(self, action: Callable[[], object]) -> None:
        try:
            action()
        except OMOTE_ERRORS as error:
            self._problems.add(error)

    def _controls(self, imgui: Any) -> None:
        playback = self.playback
        if imgui.button("stop##timeline" if playback.playing else "play##timeline"):
            self._try(playback.toggle)
        imgui.same_line()
        if imgui.button("release##timeline"):
            playback.stop()
        if imgui.is_item_hovered():
            imgui.set_tooltip("ends what plays here, and what moved the face before moves it again")
        imgui.same_line()
        imgui.text(f"{playback.position_s:.2f} of {playback.length_s:.2f} s")

    def _track(self, imgui: Any) -> None:
        corner, line = imgui.get_cursor_screen_pos(), imgui.get_font_size()
        width, height = max(imgui.get_content_region_avail().x, line), line * _TRACK_LINES
        both = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_right
        imgui.invisible_button("track", imgui.ImVec2(width, height), both)
        inset = line * _KEY_LINES  # so that a key at 0 is seen whole
        scale = (width - 2.0 * inset) / self.playback.shown_s
        self._mouse(imgui, corner.x + inset, scale, line)
        self._draw_track(imgui, corner, width, height, scale)

    def _mouse(self, imgui: Any, left: float, scale: float, line: float) -> None:
        """Drag the line or a key with the left button, mark a range of a recording with the right one."""
        playback, at_s = self.playback, (imgui.get_io().mouse_pos.x - left) / scale
        if not imgui.is_item_active():
            self._dragged = None
            return
        if imgui.is_mouse_down(imgui.MouseButton_.right) and self._commands.now.take is not None:
            begin = playback.range_s[0] if playback.range_s and not imgui.is_item_activated() else at_s
            playback.range_s = (begin, at_s)
            return
        if imgui.is_item_activated():
            self._dragged = playback.selected = self._key_near(at_s, _NEAR * line / scale)
        if self._dragged is not None:
            self._try(lambda: playback.move_key(self._dragged or 0, at_s))
        else:
            playback.scrub(at_s)

    def _key_near(self, at_s: float, most_s: float) -> int | None:
        if self._commands.now.take is not None:
            return None
        away = [(abs(key.at_s - at_s), i) for i, key in enumerate(self._commands.now.timeline.keys)]
        return min(away)[1] if away and min(away)[0] <= most_s else None

    def _draw_track(self, imgui: Any, corner: Any, width: float, height: float, scale: float) -> None:
        draw, line, now = imgui.get_window_draw_list(), imgui.get_font_size(), self._commands.now
        grey, vec = packed(imgui, GREY), imgui.ImVec2
        draw.add_rect_filled(corner, vec(corner.x + width, corner.y + height), packed(imgui, GREY, 0.15), 3.0)
        right, corner = corner.x + width, vec(corner.x + line * _KEY_LINES, corner.y)
        step_s = tick_s(self.playback.shown_s * _TICK_LINES * line / width)
        for i in range(int(self.playback.shown_s / step_s) + 1):
            x = corner.x + scale * i * step_s
            draw.add_line(vec(x, corner.y), vec(x, corner.y + line * 0.4), grey)
            label = f"{i * step_s:g}"
            draw.add_text(vec(label_left(x, imgui.calc_text_size(label).x, right), corner.y), grey, label)
        if self.playback.range_s is not None and now.take is not None:
            low, high = (corner.x + scale * x for x in sorted(self.playback.range_s))
            draw.add_rect_filled(vec(low, corner.y), vec(high, corner.y + height), packed(imgui, AMBER, 0.25))
        for name, at_s in now.timeline.marks.items() if now.take is None else ():
            x = corner.x + scale * at_s
            draw.add_line(vec(x, corner.y + line), vec(x, corner.y + height), packed(imgui, AMBER))
            draw.add_text(vec(x + 2, corner.y + height - line * 1.1), packed(imgui, AMBER), name)
        if now.take is None:
            self._draw_keys(imgui, corner, scale)
        x = corner.x + scale * self.playback.position_s
        draw.add_line(vec(x, corner.y), vec(x, corner.y + height), packed(imgui, RED), 2.0)

    def _draw_keys(self, imgui: Any, corner: Any, scale: float) -> None:
        draw, line, vec = imgui.get_window_draw_list(), imgui.get_font_size(), imgui.ImVec2
        y, half = corner.y + line * 1.7, line * _KEY_LINES
        for i, key in enumerate(self._commands.now.timeline.keys):
            x = corner.x + scale * key.at_s
            colour = packed(imgui, AMBER if i == self.playback.selected else LAYERS["expression"])
            draw.add_quad_filled(vec(x - half, y), vec(x, y - half), vec(x + half, y), vec(x, y + half), colour)
            if key.name:
                draw.add_text(vec(max(x - half, corner.x), y + half), packed(imgui, (1.0, 1.0, 1.0, 1.0)), key.name)

    def _key_buttons(self, imgui: Any) -> None:
        playback, flow = self.playback, Flow(imgui)
        ease = EASES[self._ease]
        if flow.button("key: present face"):
            self._try(lambda: playback.add_key(ease))
        shown = self._commands.now.expression
        if shown.name != "neutral" and not shown.name.startswith("VA:") and flow.button(f"key: {shown.name}"):
            face = shown.intensity * self._vocabulary[shown.name].weights
            self._try(lambda: playback.add_key(ease, shown.name, face))
        if flow.button("key: neutral"):
            self._try(lambda: playback.add_key(ease, "neutral", 0.0 * self._vocabulary["neutral"].weights))
        if playback.selected is not None and flow.button("delete key"):
            playback.delete_key()
        if self._capture.last is not None and flow.button("edit the recording"):
            playback.edit(self._capture.last)
        imgui.set_next_item_width(imgui.get_font_size() * 7)
        changed, self._ease = imgui.combo("easing", self._ease, list(EASES))
        if changed and playback.selected is not None:
            self._commands.set_timeline(self._commands.now.timeline.with_ease(playback.selected, EASES[self._ease]))
        imgui.set_next_item_width(imgui.get_font_size() * 7)
        _, self._mark = imgui.input_text_with_hint("##mark", "name of a mark", self._mark)
        imgui.same_line()
        if imgui.button("mark"):
            at_s = None if self._mark in self._commands.now.timeline.marks else playback.position_s
            self._try(lambda: self._commands.set_timeline(self._commands.now.timeline.with_mark(self._mark, at_s)))

    def _take_buttons(self, imgui: Any) -> None:
        flow = Flow(imgui)
        for label, how in {"keep range": "keep", "cut range out": "cut", "smooth": "smooth"}.items():
            if flow.button(label):
                self._try(lambda how=how: self.playback.edit_take(how))  # type: ignore[misc]
        above = self._capture.last
        if above is not None and flow.button("lay the last recording over it"):
            self._try(lambda: self.playback.layer(above))
        if flow.button("back to the keys"):
            self.playback.edit(None)
        imgui.text_disabled("drag with the right button: mark a range")

    def _saving(self, imgui: Any) -> None:
        is_take = self._commands.now.take is not None
        imgui.set_next_item_width(imgui.get_font_size() * 9)
        _, self._name = imgui.input_text("##show", self._name)
        imgui.same_line()
        if imgui.button("save take" if is_take else "save show"):
            self._try(self.save)
        imgui.same_line()
        if imgui.button("load"):
            self._try(self.load)
        if not is_take:
            _, self._loop = imgui.checkbox("loop", self._loop)
            self._hearing(imgui)
        if self._message:
            imgui.text_wrapped(self._message)

    def _hearing(self, imgui: Any) -> None:
        """Draw the choice of the sound that plays with the timeline."""
        sound = self._commands.now.timeline.sound
        if sound is not None:
            imgui.text_wrapped(f"sound: {sound.name}")
            if imgui.button("no sound"):
                self._try(lambda: self.playback.hear(None))
            return
        imgui.set_next_item_width(imgui.get_font_size() * 9)
        _, self._sound = imgui.input_text_with_hint("##sound", "sound, as hello.wav", self._sound)
        imgui.same_line()
        if imgui.button("play with it"):
            self._try(lambda: self.playback.hear(self._folder / self._sound.strip()))

    def load(self) -> None:
        """Edit the show or take of the name. Raises ParameterError, ControllerError: there is none, or it is wrong."""
        path = self._folder / self._name.strip()
        found = next((each for suffix in ("", *_LOADED) if (each := Path(f"{path}{suffix}")).is_file()), None)
        if found is None:
            raise ParameterError(f"{path}: no show or take of this name", hint=f"NAME with {', '.join(_LOADED)}")
        self.playback.load(found)
        self._message = f"loaded {found}"

    def save(self) -> None:
        """Write the show or take. Raises ParameterError, ControllerError: it cannot be written."""
        path = self.playback.save(self._folder, self._name, self._vocabulary, loop=self._loop)
        self._message = f"wrote {path}"


def label_left(tick: float, width: float, right: float) -> float:
    """Return where the label of a tick begins: right of it, or left of it where it would go on beyond ``right``."""
    return tick + _LABEL if tick + _LABEL + width <= right else tick - _LABEL - width


def tick_s(least_s: float) -> float:
    """Return the least of 1, 2, 5, 10 and so on, and their tenths, that is ``least_s`` or more."""
    power = 10.0 ** math.floor(math.log10(max(least_s, 1e-3)))
    return next((power * factor for factor in (1.0, 2.0, 5.0) if power * factor >= least_s), power * 10.0)
