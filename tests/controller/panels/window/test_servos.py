"""The panel's servos, links and faults, drawn in a real imgui context."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.body.messages import AskDetails, Details, Jog, StopServos
from controller.panels.overlay.colours import AMBER, BRIGHT_GREEN, GREY, LAYERS, packed
from controller.panels.window.link_list import figures, state_of
from controller.panels.window.panel import Panel, PanelOptions
from controller.panels.window.servos import ServoBars, share, tooltip
from controller.robot.robot import load_robot
from tests.controller.panels.window.drawn import LETTER, LINE, Drawn, at
from tests.controller.panels.window.screen import Places, Screen, drawn

SERVO = {
    "bus": "head", "id": 3, "name": "jawOpen", "model": "xl330-m288", "low_deg": -10.0, "high_deg": 30.0,
    "wanted_deg": 10.0, "measured_deg": 9.0, "age_s": 0.01, "temperature_c": 64.0, "voltage_v": 5.0,
    "current_a": None, "torque": True, "error": "",
}  # fmt: skip
SICK = {**SERVO, "id": 4, "name": "browLeft", "measured_deg": None, "error": "does not answer"}
LINK = {"name": "line /dev/ttyACM0", "connected": False, "error": "the port is not there", "rate_hz": 12.5,
        "jitter_ms": 1.0, "age_s": 3.2, "lost": 4, "accepted": 7, "refused": {"3": 2}}  # fmt: skip


@pytest.fixture
def screen() -> Iterator[Screen]:
    found = Screen()
    yield found
    found.imgui.destroy_context(found.context)


def test_servos_are_bars_that_are_plotted_when_clicked(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    places, sent = Places(screen.imgui, monkeypatch), []
    details = Details([SERVO, SICK], [LINK], [{"name": "head", "running": True, "fault": ""}])
    panel = Panel(PARAMETERS.neutral, sent.append, details=lambda: details)
    draw = drawn(panel, "Servos")
    for _ in range(3):
        screen.frame(draw)
    assert set(sent) == {AskDetails()}
    screen.click(draw, *places.at["jawOpen##head/3 jawOpen"])
    assert panel.servos.plotted == ["head/3 jawOpen"]
    for _ in range(3):
        screen.frame(draw)  # with its plot
    screen.click(draw, *places.at["jawOpen##head/3 jawOpen"])
    assert panel.servos.plotted == []
    assert "does not answer" in places.texts and "64 C" in places.texts and "   9.0 deg" in places.texts


def test_a_servo_is_turned_by_hand_captured_and_given_back(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    places, sent, mirrored = Places(screen.imgui, monkeypatch), [], []
    details = Details([SERVO], [], [])
    robot = load_robot(find_config("robots", "head24"), PARAMETERS)
    servo = {**SERVO, "name": robot.channels[0].name}
    details = Details([servo], [], [])
    options = PanelOptions(folder=tmp_path, robots=[robot])
    panel = Panel(PARAMETERS.neutral, sent.append, options=options, details=lambda: details)
    panel.calibrating.mirror = mirrored.append
    key = f"head/3 {servo['name']}"
    panel.servos.toggle(key)
    draw = drawn(panel, "Servos")
    for _ in range(3):
        screen.frame(draw)
    screen.click(draw, *places.at[f"jog##{key}"])  # a quarter of its way
    jogs = [each for each in sent if isinstance(each, Jog)]
    assert jogs[-1].bus == "head" and jogs[-1].servo == servo["name"] and -5.0 < jogs[-1].angle_deg < 10.0
    screen.frame(draw)
    screen.click(draw, *places.at[f"neutral###neutral{key}"])
    assert panel.calibrating._captures.of(servo).neutral == 9.0
    screen.frame(draw)
    screen.click(draw, *places.at[f"clear##{key}"])
    assert panel.calibrating._captures.of(servo).neutral is None
    screen.frame(draw)
    screen.click(draw, *places.at[f"release##{key}"])
    assert Jog("head", servo["name"], None) in sent
    screen.click(draw, *places.at["the face mirrors the servos"])
    assert mirrored == [True]
    screen.click(draw, *places.at["save calibration"])
    assert "capture all three" in panel.problems.unread[-1].text


def test_a_bar_shows_where_an_angle_is_between_the_limits() -> None:
    assert [share(SERVO, angle) for angle in (-10.0, 10.0, 30.0, 99.0)] == [0.0, 0.5, 1.0, 1.0]
    assert share(SERVO, None) is None and share({"low_deg": 0.0, "high_deg": 0.0}, 0.0) is None
    assert "id 3 on head" in tooltip(SERVO) and "64 C" in tooltip(SERVO) and "torque on" in tooltip(SERVO)
    assert "current" not in tooltip(SERVO) and tooltip(SICK).endswith("does not answer")


def test_links_tell_whether_they_are_plugged_in() -> None:
    assert state_of(LINK) == ("bad", "the port is not there")
    assert state_of({**LINK, "connected": True, "error": ""}) == ("good", "connected")
    assert state_of({"error": "no client", "connected": False}) == ("waits", "no client")
    assert state_of({"error": "", "fault": "port 8080 is taken"}) == ("bad", "port 8080 is taken")
    assert figures(LINK) == "12.5 Hz, jitter 1 ms, 3.2 s old, 4 lost, 7 taken, 2 refused"
    assert figures({}) == "0 taken"


def test_links_and_faults_are_drawn_and_faults_dismissed(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    places = Places(screen.imgui, monkeypatch)
    part = {"part": "link vmc", "state": "failed", "failures": 1, "why": "the port is taken"}
    details = Details([], [LINK], [], [part], ["bus head is not back"])
    panel = Panel(PARAMETERS.neutral, lambda request: None, details=lambda: details)
    draw = drawn(panel, "Links")
    for _ in range(3):
        screen.frame(draw)
    assert any("line /dev/ttyACM0: the port is not there" in text for text in places.texts)
    assert any("12.5 Hz" in text for text in places.texts) and "the port is taken" in places.texts
    assert "bus head is not back" in places.texts
    screen.click(draw, *places.at["dismiss##problem"])
    assert panel.problems.unread == []


def test_the_face_alone_keeps_its_stop(screen: Screen) -> None:
    sent: list[Any] = []
    panel = Panel(PARAMETERS.neutral, sent.append)
    panel._toggle_bare()
    for _ in range(3):
        screen.frame(panel)
    box = panel.stop.box
    screen.click(panel, (box.left + box.right) / 2, (box.top + box.bottom) / 2)
    assert sent == [StopServos()]


class Row(Drawn):
    """A window with room for a bar of 200 points from (10, 20) on."""

    def get_cursor_screen_pos(self) -> Any:
        return at(10.0, 20.0)

    def get_content_region_avail(self) -> Any:
        return at(200.0, 1e4)

    def color_convert_float4_to_u32(self, rgba: Any) -> int:
        return sum(round(100 * part) << 8 * i for i, part in enumerate(rgba))


@pytest.mark.parametrize(
    ("servo", "wanted_x", "measured_x"),
    [(SERVO, 110.0, 105.0), (SICK, 110.0, None), ({**SERVO, "wanted_deg": 30.0}, 210.0, 105.0)],
)
def test_a_bar_has_a_mark_where_the_servo_shall_be_and_a_line_where_it_is(
    servo: dict[str, Any], wanted_x: float, measured_x: float | None
) -> None:
    row = Row()
    ServoBars(SimpleNamespace())._bar(row, servo)  # type: ignore[arg-type]
    (low, high, ground, _), (left, right, colour, _) = row.named("add_rect_filled")
    assert (low.x, low.y, high.x, high.y) == (10.0, 20.0, 210.0, 20.0 + LINE) and ground == packed(
        row, (0.5, 0.5, 0.5, 0.25)
    )
    quarter = LINE / 4
    assert (left.x, left.y) == (wanted_x - quarter, 20.0 + quarter) and colour == packed(row, LAYERS["expression"])
    assert (right.x, right.y) == (wanted_x + quarter, 20.0 + 3 * quarter)
    lines = [(a.x, a.y, b.x, b.y, *rest) for a, b, *rest in row.named("add_line")]
    white = packed(row, (1.0, 1.0, 1.0, 1.0))
    assert lines == ([] if measured_x is None else [(measured_x, 20.0, measured_x, 20.0 + LINE, white, 2.0)])
    (((size,),),) = (row.named("dummy"),)
    assert (size.x, size.y) == (200.0, LINE)


@pytest.mark.parametrize(
    ("changes", "texts", "warnings", "muted"),
    [
        ({"temperature_c": 59.9}, ["   9.0 deg"], [], ["60 C"]),
        ({"temperature_c": 60.0}, ["   9.0 deg"], ["60 C"], []),
        ({"temperature_c": None}, ["   9.0 deg"], [], []),
        ({"measured_deg": None, "temperature_c": 20.0}, [""], [], ["20 C"]),
        ({"error": "does not answer"}, [], ["does not answer"], []),
    ],
)
def test_a_servo_is_warm_from_sixty_degrees_on(
    changes: dict[str, Any], texts: list[str], warnings: list[str], muted: list[str]
) -> None:
    row = Row()
    ServoBars(SimpleNamespace())._state(row, {**SERVO, **changes})  # type: ignore[arg-type]
    assert [text for (text,) in row.named("text")] == texts
    assert row.named("text_colored") == [(AMBER, words) for words in warnings]
    assert [text for (text,) in row.named("text_disabled")] == muted


@pytest.mark.parametrize(
    ("running", "fault", "colour", "words"),
    [(True, "", BRIGHT_GREEN, "torque on"), (False, "", GREY, "torque off"), (True, "no power", AMBER, "")],
)
def test_a_bus_tells_whether_it_drives_and_why_not(running: bool, fault: str, colour: Any, words: str) -> None:
    row = Row()
    ServoBars(SimpleNamespace())._bus(row, {"name": "head", "running": running, "fault": fault})  # type: ignore[arg-type]
    assert row.named("text_colored") == [(colour, f"bus head: {words}")]
    assert row.named("text_wrapped") == ([(fault,)] if fault else [])


def test_columns_are_as_wide_as_the_longest_name_and_state() -> None:
    row = Row()
    ServoBars(SimpleNamespace())._columns(row, ["jaw", "browLeft"])  # type: ignore[arg-type]
    assert row.named("table_setup_column") == [
        ("name", 1, 8 * LETTER + LINE), ("bar", 2), ("state", 1, 16 * LETTER)
    ]  # fmt: skip


def test_a_click_plots_and_another_one_ends_it() -> None:
    bars = ServoBars(SimpleNamespace())  # type: ignore[arg-type]
    for key, plotted in (("a", ["a"]), ("b", ["a", "b"]), ("a", ["b"]), ("b", [])):
        bars.toggle(key)
        assert bars.plotted == plotted


@pytest.mark.parametrize(
    ("low", "high", "angle", "part"),
    [(0.0, 0.0, 0.0, None), (0.0, 1.0, 0.25, 0.25), (5.0, 4.0, 4.5, None), (-4.0, 4.0, -9.0, 0.0)],
)
def test_a_share_lies_between_the_limits(low: float, high: float, angle: float, part: float | None) -> None:
    assert share({"low_deg": low, "high_deg": high}, angle) == part
