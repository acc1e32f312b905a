"""What the list of links says of each, in which colour, and which parts are not at work."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from controller.panels.overlay.colours import AMBER, BRIGHT_GREEN, GREY
from controller.panels.window.link_list import LinkList, figures, state_of
from tests.controller.panels.window.drawn import LINE, Drawn


@pytest.mark.parametrize(
    ("link", "state"),
    [
        ({}, ("good", "connected")),
        ({"connected": True, "last_fault": "line 3"}, ("good", "connected; last fault: line 3")),
        ({"connected": False}, ("bad", "not connected")),
        ({"connected": False, "error": "no client"}, ("waits", "no client")),
        ({"error": "no client"}, ("waits", "no client")),
        ({"error": "port in use"}, ("bad", "port in use")),
        ({"connected": True, "error": "port in use"}, ("good", "connected")),
        ({"connected": True, "fault": "ended"}, ("bad", "ended")),
        ({"fault": None, "error": None}, ("good", "connected")),
    ],
)
def test_a_link_is_connected_waits_or_is_in_trouble(link: dict[str, Any], state: tuple[str, str]) -> None:
    assert state_of(link) == state


@pytest.mark.parametrize(
    ("link", "said"),
    [
        ({}, "0 taken"),
        ({"accepted": 7, "refused": {1: 2, 4: 3}}, "7 taken, 5 refused"),
        ({"refused": None, "lost": 0}, "0 taken"),
        ({"rate_hz": 60.0, "jitter_ms": 1.25, "age_s": 0.5, "lost": 3, "accepted": 9},
         "60 Hz, jitter 1.25 ms, 0.5 s old, 3 lost, 9 taken"),
        ({"rate_hz": 0.0, "jitter_ms": None, "age_s": None}, "0 Hz, jitter 0 ms, nothing yet, 0 taken"),
        ({"rate_hz": 1.0, "age_s": 0.0}, "1 Hz, jitter 0 ms, 0 s old, 0 taken"),
    ],
)  # fmt: skip
def test_a_link_says_what_it_knows_of_its_rate_and_counts(link: dict[str, Any], said: str) -> None:
    assert figures(link) == said


@pytest.mark.parametrize(
    ("link", "colour"),
    [({}, BRIGHT_GREEN), ({"error": "no client"}, GREY), ({"error": "port in use"}, AMBER), ({"fault": "x"}, AMBER)],
)
def test_each_link_has_a_dot_in_the_colour_of_its_state(link: dict[str, Any], colour: tuple[float, ...]) -> None:
    packed: list[Any] = []
    drawn: Any = Drawn()
    drawn.color_convert_float4_to_u32 = lambda rgba: packed.append(rgba) or 7
    feed: Any = SimpleNamespace(details=SimpleNamespace(links=[], parts=[]))
    LinkList(feed)._link(drawn, {"name": "livelink", **link})
    ((centre, radius, _),) = drawn.named("add_circle_filled")
    assert packed == [colour] and (centre.x, centre.y) == (LINE / 2, LINE / 2) and radius == LINE / 3.5
    ((text,),) = drawn.named("text_wrapped")
    assert text.startswith("livelink: ")
    ((at,),) = drawn.named("set_cursor_screen_pos")
    assert at.x > centre.x + radius and drawn.named("indent") == drawn.named("unindent")
