"""The panel's servos, links and faults, drawn in a real imgui context."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.body.messages import AskDetails, Details, Jog, StopServos
from controller.panels.window.link_list import figures, state_of
from controller.panels.window.panel import Panel, PanelOptions
from controller.panels.window.servos import share, tooltip
from controller.robot.robot import load_robot
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
