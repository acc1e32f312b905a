"""Draws the calibration of the servos that were clicked: jog, capture, save; and lets the face mirror the servos."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from controller.base.errors import OMOTE_ERRORS
from controller.body.messages import Jog, PanelRequest
from controller.panels.session.feed import servo_key
from controller.panels.session.problems import Problems
from controller.panels.session.servo_captures import MARKS, Captured, ServoCaptures
from controller.panels.window.flow import Flow


class Calibrating:
    """Draws it.

    captures : keeps the angles. send : sends requests to the body. mirror : lets the face show what the servos show,
    or no longer; None where it cannot.
    """

    def __init__(
        self, captures: ServoCaptures, send: Callable[[PanelRequest], None], problems: Problems,
        mirror: Callable[[bool], None] | None = None,
    ) -> None:  # fmt: skip
        self._captures, self._send, self._problems, self.mirror = captures, send, problems, mirror
        self._jogged: dict[str, float] = {}
        self._mirrors, self._name, self._message = False, "mine", ""

    def __call__(self, servos: list[Mapping[str, Any]]) -> None:
        """Draw for the servos that were clicked; called once per frame."""
        from imgui_bundle import imgui  # optional

        if self.mirror is not None:
            changed, self._mirrors = imgui.checkbox("the face mirrors the servos", self._mirrors)
            if changed:
                self.mirror(self._mirrors)
        for servo in servos:
            self._servo(imgui, servo)
        if not servos:
            return
        imgui.set_next_item_width(imgui.get_font_size() * 7)
        _, self._name = imgui.input_text("##calibration", self._name)
        imgui.same_line()
        if imgui.button("save calibration"):
            self.save(self._name)
        if self._message:
            imgui.text_wrapped(self._message)

    def _servo(self, imgui: Any, servo: Mapping[str, Any]) -> None:
        """The slider that turns one servo, and what was captured of it."""
        key, now = servo_key(servo), servo.get("measured_deg")
        shown = self._jogged.get(key, float(servo["wanted_deg"]))
        imgui.set_next_item_width(-imgui.get_font_size() * 5)
        low, high = float(servo["low_deg"]), float(servo["high_deg"])
        moved, angle = imgui.slider_float(f"jog##{key}", shown, low, high, f"{servo['name']} %.1f deg")
        if moved:
            self.jog(servo, angle)
        flow, captured = Flow(imgui), self._captures.of(servo)
        for mark in MARKS:
            kept = getattr(captured, mark)
            if flow.button(f"{mark}{'' if kept is None else f' {kept:g}'}###{mark}{key}") and now is not None:
                self._try(lambda mark=mark: self._captures.capture(servo, mark))  # type: ignore[misc]
        if captured != Captured() and flow.button(f"clear##{key}"):
            self._captures.clear(servo)
        if key not in self._jogged:
            return
        if flow.button(f"release##{key}"):
            self.jog(servo, None)
        if imgui.is_item_hovered():
            imgui.set_tooltip("the servo follows the face again")

    def jog(self, servo: Mapping[str, Any], angle_deg: float | None) -> None:
        """Turn a servo; None lets it follow the face again."""
        if angle_deg is None:
            self._jogged.pop(servo_key(servo), None)
        else:
            self._jogged[servo_key(servo)] = angle_deg
        self._send(Jog(str(servo["bus"]), str(servo["name"]), angle_deg))

    def forget(self) -> None:
        """The body has given everything back."""
        self._jogged = {}

    def save(self, name: str) -> None:
        """Write the calibrations; reports what cannot be written."""

        def write() -> None:
            paths = self._captures.save(name)
            key = f'calibration = "{name.strip()}"'
            self._message = f"wrote {', '.join(map(str, paths))}; put it beside the robot file, and there: {key}"

        self._try(write)

    def _try(self, action: Callable[[], object]) -> None:
        try:
            action()
        except OMOTE_ERRORS as error:
            self._problems.add(error)
