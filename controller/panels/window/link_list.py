"""Links with rate, age, loss, plug state and the last error; parts that failed, with when they come back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from controller.panels.overlay.colours import AMBER, BRIGHT_GREEN, GREY
from controller.panels.session.feed import Feed


class LinkList:
    """Draws them. feed : the body's reports on links."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        links = self._feed.details.links
        if not links:
            imgui.text_wrapped("asking the links" if self._feed.waiting else "this stage has no links")
        for link in links:
            self._link(imgui, link)
        failed = [part for part in self._feed.details.parts if part["state"] != "at work"]
        if failed:
            imgui.separator_text("not at work")
        for part in failed:
            imgui.text_colored(imgui.ImVec4(*AMBER), f"{part['part']}: {part['state']}")
            imgui.text_wrapped(str(part["why"]))

    def _link(self, imgui: Any, link: Mapping[str, Any]) -> None:
        state, words = state_of(link)
        colour = {"good": BRIGHT_GREEN, "waits": GREY}.get(state, AMBER)
        draw, at, size = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos(), imgui.get_font_size()
        centre = imgui.ImVec2(at.x + size / 2, at.y + size / 2)
        draw.add_circle_filled(centre, size / 3.5, imgui.color_convert_float4_to_u32(imgui.ImVec4(*colour)))
        imgui.set_cursor_screen_pos(imgui.ImVec2(at.x + 1.3 * size, at.y))
        imgui.text_wrapped(f"{link['name']}: {words}")
        imgui.indent(1.3 * size)
        imgui.text_disabled(figures(link))
        imgui.unindent(1.3 * size)


def state_of(link: Mapping[str, Any]) -> tuple[str, str]:
    """Return ``good``, ``waits`` or ``bad``, and in words whether a link is plugged in and what was wrong last."""
    fault = str(link.get("fault") or "")
    if fault:
        return "bad", fault
    error = str(link.get("error") or "")
    if link.get("connected", not error):
        last = str(link.get("last_fault") or "")
        return "good", "connected" + (f"; last fault: {last}" if last else "")
    return ("waits" if error == "no client" else "bad"), error or "not connected"


def figures(link: Mapping[str, Any]) -> str:
    """Return the rate, jitter, age, loss and counts, as far as a link reports them."""
    found = []
    if link.get("rate_hz") is not None:
        found.append(f"{link['rate_hz']:g} Hz, jitter {link.get('jitter_ms') or 0:g} ms")
        age = link.get("age_s")
        found.append("nothing yet" if age is None else f"{age:g} s old")
    if link.get("lost"):
        found.append(f"{link['lost']} lost")
    refused = sum((link.get("refused") or {}).values())
    found.append(f"{link.get('accepted', 0)} taken" + (f", {refused} refused" if refused else ""))
    return ", ".join(found)
