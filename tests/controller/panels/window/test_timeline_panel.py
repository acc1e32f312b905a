"""controller.panels.session.playback and timeline_panel"""

from __future__ import annotations

import sys
import tempfile
import time
import wave
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.errors import ControllerError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.body.messages import HoldAll, Show
from controller.links.line.script import load_script
from controller.panels.overlay.colours import AMBER, GREY, LAYERS, RED, packed
from controller.panels.session.playback import Playback
from controller.panels.session.sound import SoundPlayer
from controller.panels.window.panel import Panel, PanelOptions
from controller.panels.window.timeline_panel import TimelinePanel, label_left, tick_s
from controller.takes.livelink import Take
from controller.takes.plain import plain_take, write_plain
from controller.takes.timeline import EASES, Key, Timeline, load_timeline, save_show
from tests.controller.panels.window.drawn import LINE, Drawn, at
from tests.controller.panels.window.screen import Places, Screen, drawn

JAW = PARAMETERS.index("jawOpen")


@pytest.fixture
def screen() -> Iterator[Screen]:
    found = Screen()
    yield found
    found.imgui.destroy_context(found.context)


class Desk:
    """A panel in a folder; the playback's clock is the test's."""

    def __init__(self, folder: Path) -> None:
        self.sent: list[Any] = []
        self.values, self.now_s = PARAMETERS.neutral(), 0.0
        self.panel = Panel(lambda: self.values, self.sent.append, options=PanelOptions(folder=folder))
        self.commands, playback = self.panel.commands, self.panel.playback
        playback._clock, playback._last_s = lambda: self.now_s, 0.0
        self.playback: Playback = playback

    def key(self, at_s: float, jaw: float) -> None:
        self.values[JAW] = jaw
        self.playback.position_s = at_s
        self.playback.add_key("linear")


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def test_keys_are_played_scrubbed_and_given_back(desk: Desk) -> None:
    desk.key(0.0, 0.0)
    desk.key(2.0, 1.0)
    desk.playback.scrub(1.0)
    assert desk.sent[-1] == HoldAll((JAW,), (0.5,))
    desk.playback.toggle()
    desk.now_s += 0.5
    desk.playback()
    assert desk.sent[-1] == HoldAll((JAW,), (0.75,)) and desk.playback.playing
    desk.now_s += 5.0
    desk.playback()
    assert desk.sent[-2:] == [HoldAll((JAW,), (1.0,)), HoldAll((JAW,), None)] and not desk.playback.playing
    desk.playback.toggle()
    assert desk.playback.position_s == 0.0 and desk.playback.playing


def test_every_edit_of_a_timeline_is_undone(desk: Desk) -> None:
    desk.key(0.0, 0.1)
    desk.key(1.0, 1.0)
    two = desk.commands.now.timeline
    for at_s in (1.1, 1.3, 1.5):
        desk.playback.move_key(1, at_s)
    desk.commands.end_step()
    assert desk.commands.now.timeline.keys[1].at_s == 1.5
    desk.playback.move_key(0, 9.0)
    assert desk.commands.now.timeline.keys[0].at_s == 1.49  # it keeps its place
    desk.playback.selected = 0
    desk.playback.delete_key()
    assert len(desk.commands.now.timeline.keys) == 1
    for _ in range(3):
        desk.commands.undo()
    assert desk.commands.now.timeline is two
    desk.commands.return_to_neutral()
    assert desk.commands.now.timeline is two


def test_a_recording_is_cut_smoothed_saved_and_taken_back(desk: Desk, tmp_path: Path) -> None:
    values = np.zeros((101, len(PARAMETERS)))
    values[:, JAW] = np.linspace(0.0, 1.0, 101)
    take = Take("a", np.linspace(0.0, 10.0, 101), values, np.ones(len(PARAMETERS), bool),
                PARAMETERS.low, PARAMETERS.high)  # fmt: skip
    desk.commands.set_take(take)
    assert desk.playback.length_s == 10.0
    desk.playback.range_s = (2.0, 8.0)
    desk.playback.edit_take("keep")
    desk.playback.edit_take("smooth")
    assert desk.playback.length_s == pytest.approx(6.0)
    path = desk.playback.save(tmp_path, "mine", desk.panel.expressions._vocabulary, loop=False)
    assert plain_take(path, PARAMETERS).values[0, JAW] == pytest.approx(0.2)
    desk.commands.undo()
    desk.commands.undo()
    assert desk.commands.now.take is take


def test_the_window_makes_a_show_of_two_keys(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, desk: Desk, tmp_path: Path
) -> None:
    places, draw = Places(screen.imgui, monkeypatch), drawn(desk.panel, "Time")

    def click(label: str) -> None:
        screen.click(draw, *places.at[label])
        for _ in range(2):
            screen.frame(draw)

    for _ in range(3):
        screen.frame(draw)
    click("save show")
    assert "no keys" in desk.panel.problems.unread[-1].text
    click("all 1##problem") if "all 1##problem" in places.at else click("dismiss##problem")
    desk.values[JAW] = 0.6
    click("key: present face")
    desk.commands.show("happiness", 1.0)
    screen.frame(draw)
    x, y = places.at["track"]
    screen.click(draw, x, y)
    assert desk.playback.position_s > 0.1
    click("key: happiness")
    click("save show")
    saved = load_timeline(tmp_path / "my_show.toml", PARAMETERS)
    assert [key.name for key in saved.keys] == ["", "happiness"] and saved.keys[1].values["mouthSmileLeft"] > 0.2
    assert not any(isinstance(each, HoldAll) for each in desk.sent[:1]) and Show("happiness", 1.0) in desk.sent
    desk.commands.undo()
    desk.commands.undo()
    desk.commands.undo()
    assert desk.commands.now.timeline == Timeline()


def wait_until(done: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 30.0
    while not done() and time.monotonic() < end_s:
        time.sleep(0.02)
    assert done()


def sound(path: Path, seconds: float) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 8000, 0, "NONE", ""))
        file.writeframes(b"\0\0" * round(8000 * seconds))
    return path


def test_the_sound_plays_with_the_timeline_from_where_its_line_is(desk: Desk, tmp_path: Path) -> None:
    heard = sound(tmp_path / "hello.wav", 3.0)
    program = "import sys, time, wave; w = wave.open(sys.argv[1]); s = w.getnframes() / w.getframerate()"
    program += f"; open({str(tmp_path / 'heard')!r}, 'a').write(f'{{s:g}} '); time.sleep(60)"
    player = desk.playback._sound = SoundPlayer([sys.executable, "-c", program])
    desk.key(0.0, 0.0)
    desk.key(1.0, 1.0)
    desk.playback.hear(heard)
    assert desk.playback.length_s == 3.0
    desk.playback.scrub(0.5)
    desk.playback.toggle()
    wait_until(lambda: (tmp_path / "heard").exists() and (tmp_path / "heard").read_text() == "2.5 ")
    assert player.playing
    desk.playback.scrub(0.0)
    assert not player.playing and not list(Path(tempfile.gettempdir()).glob("omote-*.wav"))
    desk.commands.undo()
    assert desk.commands.now.timeline.sound is None and desk.playback.length_s == 1.0


def test_a_sound_that_is_none_is_refused(desk: Desk, tmp_path: Path) -> None:
    (tmp_path / "no.wav").write_text("no sound")
    for name in ("no.wav", "nowhere.wav"):
        with pytest.raises(ControllerError, match=name):
            desk.playback.hear(tmp_path / name)
    assert desk.commands.now.timeline.sound is None


def test_a_show_is_saved_with_its_sound_and_loaded_again(desk: Desk, tmp_path: Path) -> None:
    desk.key(0.0, 0.0)
    desk.key(2.0, 1.0)
    desk.playback.hear(sound(tmp_path / "hello.wav", 1.0))
    panel = desk.panel.timeline
    panel._name = "mine"
    panel.save()
    kept = desk.commands.now.timeline
    assert load_script(str(tmp_path / "mine.toml"), PARAMETERS).sound == tmp_path / "hello.wav"
    desk.commands.set_timeline(Timeline())
    panel.load()
    assert desk.commands.now.timeline == kept
    desk.commands.undo()
    assert desk.commands.now.timeline == Timeline()
    with pytest.raises(ParameterError, match="must be in its folder"):
        save_show(tmp_path / "below" / "show.toml", kept, PARAMETERS)
    panel._name = "nothing"
    with pytest.raises(ParameterError, match="no show or take of this name"):
        panel.load()


def test_a_take_is_loaded_and_another_laid_over_it(desk: Desk, tmp_path: Path) -> None:
    times, smile = np.array([0.0, 1.0, 2.0]), PARAMETERS.index("mouthSmileLeft")
    values, mask = np.zeros((3, len(PARAMETERS))), np.zeros(len(PARAMETERS), bool)
    values[:, JAW], mask[JAW] = 0.5, True
    write_plain(tmp_path / "a.csv", times, values, mask, PARAMETERS)
    panel = desk.panel.timeline
    panel._name = "a"
    panel.load()
    above = np.zeros((2, len(PARAMETERS)))
    above[:, smile] = 0.8
    over = Take(
        "over", np.array([0.0, 0.5]), above, np.arange(len(PARAMETERS)) == smile, PARAMETERS.low, PARAMETERS.high
    )
    desk.playback.scrub(1.0)
    desk.playback.layer(over)
    take = desk.commands.now.take
    assert take is not None and take.duration_s == 2.0
    face = take.sample(1.25, PARAMETERS.neutral())
    assert face[[JAW, smile]] == pytest.approx([0.5, 0.8]) and take.sample(0.5, PARAMETERS.neutral())[smile] == 0.0
    desk.commands.undo()
    desk.commands.undo()
    with pytest.raises(ParameterError, match="no recording to lay"):
        desk.playback.layer(over)


def test_ticks_are_round_and_far_enough_apart() -> None:
    assert [tick_s(least) for least in (0.03, 0.1, 0.6, 3.0, 7.0)] == pytest.approx([0.05, 0.1, 1.0, 5.0, 10.0])


def test_the_label_of_the_last_tick_is_not_cut() -> None:
    assert label_left(100.0, 10.0, 120.0) == 102.0
    assert label_left(115.0, 10.0, 120.0) == 103.0


def test_a_timeline_without_keys_plays_nothing(desk: Desk) -> None:
    desk.playback.toggle()
    desk.playback.scrub(0.5)
    desk.playback.stop()
    assert desk.sent == [] and not desk.playback.playing
    desk.commands.set_timeline(Timeline((Key(0.0, {}),)))
    desk.playback.scrub(0.5)
    assert desk.sent == []


class Track(Drawn):
    """A window in which the mouse is at ``x`` over the track; ``held`` : the button that is down, 0 left, 1 right."""

    ButtonFlags_ = SimpleNamespace(mouse_button_left=1, mouse_button_right=2)
    MouseButton_ = SimpleNamespace(left=0, right=1)

    def __init__(self, x: float = 0.0, held: int | None = None, *, first: bool = True) -> None:
        super().__init__()
        self._x, self._held, self._first = x, held, first

    def get_io(self) -> Any:
        return SimpleNamespace(mouse_pos=at(self._x, 0.0))

    def is_item_active(self) -> bool:
        return self._held is not None

    def is_item_activated(self) -> bool:
        return self._held is not None and self._first

    def is_mouse_down(self, button: int) -> bool:
        return button == self._held

    def color_convert_float4_to_u32(self, rgba: Any) -> int:
        return sum(round(100 * part) << 8 * i for i, part in enumerate(rgba))


class Track4:
    """The panel of a timeline of 4 s with keys at 1 and 3 s, which lies at 100 points, 50 points to a second."""

    def __init__(self, *, take: bool = False) -> None:
        self.asked = list[tuple[Any, ...]]()
        note = lambda name: lambda *given: self.asked.append((name, *given))  # noqa: E731
        self.playback: Any = SimpleNamespace(
            shown_s=4.0, position_s=2.0, range_s=None, selected=None, move_key=note("move"), scrub=note("scrub")
        )
        keys = (Key(1.0, {}, "linear", "joy"), Key(3.0, {}, "linear"))
        timeline = SimpleNamespace(keys=keys, marks={"here": 1.5})
        self.now: Any = SimpleNamespace(take=object() if take else None, timeline=timeline)
        self.panel: Any = object.__new__(TimelinePanel)
        self.panel.playback, self.panel._commands = self.playback, SimpleNamespace(now=self.now)
        self.panel._dragged, self.panel._problems = None, SimpleNamespace(add=note("problem"))

    def mouse(self, at_s: float, held: int | None = 0, *, first: bool = True) -> None:
        self.panel._mouse(Track(100.0 + 50.0 * at_s, held, first=first), 100.0, 50.0, LINE)


NEAR_S = 0.45 * LINE / 50.0  # so far beside a key it is taken


@pytest.mark.parametrize(
    ("pressed_s", "key"),
    [(1.0, 0), (1.0 + 0.99 * NEAR_S, 0), (1.0 - 0.99 * NEAR_S, 0), (1.0 + 1.01 * NEAR_S, None), (3.0, 1), (2.0, None)],
)
def test_a_key_near_the_mouse_is_dragged_and_elsewhere_the_line(pressed_s: float, key: int | None) -> None:
    track = Track4()
    track.mouse(pressed_s)
    track.mouse(2.5, first=False)
    assert track.playback.selected == key
    assert [name for name, *_ in track.asked] == (["scrub"] * 2 if key is None else ["move"] * 2)
    assert track.asked[-1][-1] == pytest.approx(2.5) and (key is None or track.asked[-1][1] == key)
    track.mouse(0.5, None)  # let go
    assert len(track.asked) == 2 and track.panel._dragged is None and track.playback.selected == key


@pytest.mark.parametrize("take", [False, True])
def test_the_right_button_marks_a_range_of_a_recording(take: bool) -> None:
    track = Track4(take=take)
    track.mouse(0.5, 1)
    assert track.playback.range_s == ((0.5, 0.5) if take else None)
    track.mouse(2.5, 1, first=False)
    assert track.playback.range_s == ((0.5, 2.5) if take else None)
    track.mouse(1.5, 1)
    assert track.playback.range_s == ((1.5, 1.5) if take else None)
    track.mouse(1.0)
    assert track.playback.selected == (None if take else 0)  # a recording has no keys


@pytest.mark.parametrize("take", [False, True])
def test_a_track_has_its_scale_keys_marks_range_and_line(take: bool) -> None:
    track, drawn = Track4(take=take), Track()
    track.playback.range_s, track.playback.selected = (3.0, 2.0), 1
    inset, height = 0.35 * LINE, 3.2 * LINE
    track.panel._draw_track(drawn, at(100.0, 20.0), 200.0 + 2 * inset, height, 50.0)
    left = 100.0 + inset
    ground, *ranges = drawn.named("add_rect_filled")
    corner, far = ground[:2]
    assert (corner.x, corner.y, far.x, far.y) == (100.0, 20.0, 300.0 + 2 * inset, 20.0 + height)
    assert ground[2] == packed(drawn, GREY, 0.15)
    lines = [(a.x, a.y, b.x, b.y, *rest) for a, b, *rest in drawn.named("add_line")]
    ticks, others = [line[:4] for line in lines[:5]], lines[5:]
    assert ticks == [pytest.approx((left + 50.0 * k, 20.0, left + 50.0 * k, 20.0 + 0.4 * LINE)) for k in range(5)]
    assert others[-1][:4] == pytest.approx((left + 100.0, 20.0, left + 100.0, 20.0 + height))
    assert others[-1][4:] == (packed(drawn, RED), 2.0)
    texts = [(place.x, place.y, text) for place, _, text in drawn.named("add_text")]
    assert [text for *_, text in texts[:5]] == ["0", "1", "2", "3", "4"]
    assert [x for x, *_ in texts[:4]] == pytest.approx([left + 50.0 * k + 2.0 for k in range(4)])
    assert [y for _, y, _ in texts[:5]] == [20.0] * 5
    quads = drawn.named("add_quad_filled")
    if take:
        ((low, high, colour),) = ranges
        assert (low.x, low.y, high.x, high.y) == pytest.approx((left + 100.0, 20.0, left + 150.0, 20.0 + height))
        assert colour == packed(drawn, AMBER, 0.25) and not quads and len(texts) == 5 and len(others) == 1
        return
    assert not ranges and others[0][:4] == pytest.approx((left + 75.0, 20.0 + LINE, left + 75.0, 20.0 + height))
    assert texts[5] == (pytest.approx(left + 77.0), pytest.approx(20.0 + height - 1.1 * LINE), "here")
    y = 20.0 + 1.7 * LINE
    for x, colour, quad in zip((left + 50.0, left + 150.0), (LAYERS["expression"], AMBER), quads, strict=True):
        corners = [(corner.x, corner.y) for corner in quad[:4]]
        wanted = [(x - inset, y), (x, y - inset), (x + inset, y), (x, y + inset)]
        assert np.allclose(corners, wanted) and quad[4] == packed(drawn, colour)
    assert texts[6] == (pytest.approx(left + 50.0 - inset), pytest.approx(y + inset), "joy") and len(texts) == 7


@pytest.mark.parametrize(
    ("least_s", "tick"),
    [(0.0, 0.001), (0.001, 0.001), (0.0011, 0.002), (0.002, 0.002), (0.5, 0.5), (0.51, 1.0), (1.0, 1.0), (7.0, 10.0)],
)
def test_a_tick_is_the_least_round_time_that_is_long_enough(least_s: float, tick: float) -> None:
    assert tick_s(least_s) == pytest.approx(tick)


@pytest.mark.parametrize(("right", "left"), [(100.0, 50.0 + 2.0), (82.0, 52.0), (81.9, 50.0 - 2.0 - 30.0)])
def test_a_label_stands_left_of_its_tick_where_it_would_be_cut(right: float, left: float) -> None:
    assert label_left(50.0, 30.0, right) == left


@pytest.mark.parametrize(("changed", "selected", "told"), [(True, 0, True), (True, None, False), (False, 0, False)])
def test_the_easing_of_the_chosen_key_is_changed(changed: bool, selected: int | None, told: bool) -> None:
    track, drawn, set_ = Track4(), Track(), list[Any]()
    track.playback.selected, track.panel._ease, track.panel._mark = selected, 1, ""
    track.panel._capture, track.now.expression = SimpleNamespace(last=None), Show("neutral", 1.0)
    track.now.timeline.with_ease = lambda key, ease: (key, ease)
    track.panel._commands.set_timeline = set_.append
    drawn.combo = lambda *given: (changed, 2 if changed else 1)  # type: ignore[attr-defined]
    drawn.input_text_with_hint = lambda *given: (False, "")  # type: ignore[attr-defined]
    track.panel._key_buttons(drawn)
    assert set_ == ([(0, EASES[2])] if told else [])
    wanted = ["key: present face", "key: neutral", *(["delete key"] if selected is not None else []), "mark"]
    assert [label for (label,) in drawn.named("button")] == wanted
    assert drawn.named("set_next_item_width") == [(7 * LINE,)] * 2


@pytest.mark.parametrize(("take", "label", "loops"), [(False, "save show", 1), (True, "save take", 0)])
def test_a_show_may_repeat_and_have_a_sound_and_a_recording_may_not(take: bool, label: str, loops: int) -> None:
    track, drawn = Track4(take=take), Track()
    track.panel._name, track.panel._loop, track.panel._sound, track.panel._message = "a", False, "", ""
    track.now.timeline.sound = None
    drawn.input_text = lambda *given: (False, "a")  # type: ignore[attr-defined]
    drawn.input_text_with_hint = lambda *given: (False, "")  # type: ignore[attr-defined]
    drawn.checkbox = lambda *given: drawn.calls.append(("checkbox", *given)) or (False, False)  # type: ignore[attr-defined, func-returns-value]
    track.panel._saving(drawn)
    assert [each for (each,) in drawn.named("button")] == [label, "load", *["play with it"] * loops]
    assert drawn.named("checkbox") == [("loop", False)] * loops
