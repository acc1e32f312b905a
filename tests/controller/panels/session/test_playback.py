"""The timeline's line: how it moves, what it shows and holds, and how keys and recordings are edited at it."""

from __future__ import annotations

import math
import wave
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.body.messages import HoldAll
from controller.panels.session.commands import Commands
from controller.panels.session.playback import Playback
from controller.takes.livelink import Take
from controller.takes.reader import load_take
from controller.takes.timeline import Key, Timeline, load_timeline
from controller.vocabulary.vocabulary import Vocabulary

JAW, SMILE = PARAMETERS.index("jawOpen"), PARAMETERS.index("mouthSmileLeft")


class Silent:
    """Stands for a sound player: what it was asked for."""

    def __init__(self) -> None:
        self.heard: list[object] = []

    def start(self, path: Path, at_s: float) -> None:
        self.heard.append((path, at_s))

    def stop(self) -> None:
        self.heard.append("stop")


class Desk:
    """A playback with a clock that is set by hand."""

    def __init__(self, timeline: Timeline | None = None, take: Take | None = None) -> None:
        self.sent: list[object] = []
        self.commands = Commands(self.sent.append)  # type: ignore[arg-type]
        self.commands.set_timeline(timeline or Timeline())
        if take is not None:
            self.commands.set_take(take)
        self.now_s, self.sound = 100.0, Silent()
        self.face = PARAMETERS.neutral()
        self.play = Playback(
            self.commands, lambda: self.face, self.sent.append, lambda: self.now_s, sound=self.sound,  # type: ignore[arg-type]
        )  # fmt: skip

    def after(self, seconds: float) -> None:
        self.now_s += seconds
        self.play()


def keys(**other: object) -> Timeline:
    """The jaw opens from 0 to 1 between 1 and 3 s."""
    return Timeline((Key(1.0, {"jawOpen": 0.0}), Key(3.0, {"jawOpen": 1.0}, "linear")), **other)  # type: ignore[arg-type]


def take(length: int = 5, parameter: int = SMILE) -> Take:
    """A recording of one parameter that rises by 0.1 each 0.5 s."""
    values = np.tile(PARAMETERS.neutral(), (length, 1))
    values[:, parameter] = 0.1 * np.arange(length)
    mask = np.zeros(len(PARAMETERS), bool)
    mask[parameter] = True
    return Take("take.csv", 0.5 * np.arange(length), values, mask, PARAMETERS.low, PARAMETERS.high)


def sound(path: Path, seconds: float) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 8000, 0, "NONE", "not compressed"))
        file.writeframes(bytes(2 * round(8000 * seconds)))
    return path


def test_the_line_moves_with_the_clock_only_while_it_plays_and_stops_at_the_end() -> None:
    desk = Desk(keys())
    desk.after(7.0)
    assert desk.play.position_s == 0.0 and desk.sent == []
    desk.play.toggle()
    desk.after(1.5)
    assert desk.play.position_s == 1.5 and desk.play.playing
    assert desk.sent == [HoldAll((JAW,), (0.25,))]
    desk.after(9.0)
    assert desk.play.position_s == 3.0 and not desk.play.playing
    assert desk.sent[1:] == [HoldAll((JAW,), (1.0,)), HoldAll((JAW,), None)]
    desk.play.stop()
    assert len(desk.sent) == 3  # nothing is held any more


def test_playing_begins_again_at_the_end_and_goes_on_where_it_was_stopped() -> None:
    desk = Desk(keys())
    desk.play.scrub(2.0)
    desk.play.toggle()
    desk.after(0.5)
    desk.play.toggle()
    assert desk.play.position_s == 2.5 and not desk.play.playing
    desk.play.toggle()
    desk.after(0.5)
    assert desk.play.position_s == 3.0
    desk.play.toggle()
    assert desk.play.position_s == 0.0 and desk.play.playing


def test_without_keys_nothing_plays() -> None:
    desk = Desk()
    desk.play.toggle()
    assert not desk.play.playing and desk.play.length_s == 0.0 and desk.play.shown_s == 1.0
    desk.play.scrub(0.5)
    assert desk.sent == []


def test_scrubbing_stops_stays_on_the_scale_and_shows_the_face_there() -> None:
    desk = Desk(keys())
    desk.play.toggle()
    desk.play.scrub(1.5)
    assert not desk.play.playing and desk.sent == [HoldAll((JAW,), (0.25,))]
    desk.play.scrub(-1.0)
    assert desk.play.position_s == 0.0
    desk.play.scrub(99.0)
    assert desk.play.position_s == desk.play.shown_s == pytest.approx(3.3)  # a tenth longer than the keys


def test_a_recording_is_shown_instead_of_the_keys(tmp_path: Path) -> None:
    desk = Desk(keys(sound=sound(tmp_path / "a.wav", 9.0)), take())
    assert desk.play.length_s == 2.0
    desk.play.scrub(1.25)
    (held,) = desk.sent
    assert isinstance(held, HoldAll) and held.indices == (SMILE,) and held.values == pytest.approx((0.25,))
    desk.play.toggle()
    assert (desk.commands.now.timeline.sound, 1.25) not in desk.sound.heard  # the sound belongs to the keys


def test_a_sound_plays_from_the_line_on_and_may_be_longer_than_the_keys(tmp_path: Path) -> None:
    path = sound(tmp_path / "a.wav", 4.5)
    desk = Desk(keys(sound=path))
    assert desk.play.length_s == pytest.approx(4.5)
    desk.play.scrub(2.0)
    desk.sound.heard.clear()
    desk.play.toggle()
    assert desk.sound.heard == [(path, 2.0)]
    desk.play.close()
    assert desk.sound.heard[-1] == "stop" and not desk.play.playing
    desk.commands.set_timeline(keys(sound=sound(tmp_path / "b.wav", 2.0)))
    assert desk.play.length_s == 3.0
    desk.commands.set_timeline(keys(sound=tmp_path / "lost.wav"))
    assert desk.play.length_s == 3.0  # a lost sound has no length


def test_hearing_a_sound_that_cannot_be_played_changes_nothing(tmp_path: Path) -> None:
    desk, path = Desk(keys()), sound(tmp_path / "a.wav", 1.0)
    desk.play.hear(path)
    assert desk.commands.now.timeline.sound == path
    with pytest.raises(ControllerError):
        desk.play.hear(tmp_path / "lost.wav")
    assert desk.commands.now.timeline.sound == path
    desk.play.hear(None)
    assert desk.commands.now.timeline.sound is None


def test_a_key_is_the_face_of_now_at_the_line_and_is_selected() -> None:
    desk = Desk(keys())
    desk.face[SMILE] = 0.4
    desk.play.position_s = 2.0
    desk.play.add_key("in", "smile")
    assert desk.commands.now.timeline.keys[1] == Key(2.0, {"mouthSmileLeft": 0.4}, "in", "smile")
    assert desk.play.selected == 1
    other = PARAMETERS.neutral()
    other[JAW] = 0.7
    desk.play.add_key("out", face=other)
    assert desk.commands.now.timeline.keys[1] == Key(2.0, {"jawOpen": 0.7}, "out")
    desk.play.delete_key()
    assert desk.commands.now.timeline == keys() and desk.play.selected is None
    desk.play.delete_key()
    assert desk.commands.now.timeline == keys()


@pytest.mark.parametrize(
    ("number", "to", "at"),
    [(0, -1.0, 0.0), (0, 5.0, 1.99), (1, 0.0, 1.01), (1, 5.0, 2.99), (2, 0.0, 2.01), (2, 9.0, 9.0)],
)  # fmt: skip
def test_a_key_stays_between_its_neighbours_and_one_drag_is_one_step(number: int, to: float, at: float) -> None:
    three = Timeline(tuple(Key(t, {"jawOpen": 0.1 * t}) for t in (1.0, 2.0, 3.0)))
    desk = Desk(three)
    desk.play.move_key(number, 0.5 * (at + three.keys[number].at_s))
    desk.play.move_key(number, to)
    moved = desk.commands.now.timeline.keys
    assert moved[number].at_s == pytest.approx(at) and moved[number].values == three.keys[number].values
    assert [k for i, k in enumerate(moved) if i != number] == [k for i, k in enumerate(three.keys) if i != number]
    desk.commands.undo()
    assert desk.commands.now.timeline == three


def test_a_range_of_a_recording_is_kept_or_cut_out() -> None:
    for how, length in (("keep", 1.0), ("cut", 1.2)):
        desk = Desk(take=take())
        desk.play.range_s, desk.play.position_s = (0.5, 1.5), 1.0
        desk.play.edit_take(how)
        found = desk.commands.now.take
        assert found is not None and found.duration_s == pytest.approx(length)  # what is cut out is bridged in 0.2 s
        assert desk.play.range_s is None and desk.play.position_s == 0.0
        first = found.values[0, SMILE]
        assert first == pytest.approx(0.1 if how == "keep" else 0.0)
    desk = Desk(take=take())
    with pytest.raises(ParameterError, match="no range"):
        desk.play.edit_take("keep")
    desk.play.edit_take("smooth")
    smoothed = desk.commands.now.take
    assert smoothed is not None and smoothed.values[2, SMILE] == pytest.approx(0.2, abs=0.02)
    with pytest.raises(ParameterError, match="no recording to edit"):
        Desk().play.edit_take("smooth")


def test_a_recording_is_laid_over_another_from_the_line_on() -> None:
    desk = Desk(take=take())
    desk.play.position_s = 1.0
    desk.play.layer(take(3, JAW))
    found = desk.commands.now.take
    assert found is not None and found.mask[JAW] and found.mask[SMILE]
    assert found.sample(1.5, PARAMETERS.neutral())[JAW] == pytest.approx(0.1, abs=1e-6)
    desk.play.position_s = 50.0
    desk.play.layer(take(3, JAW))  # beyond its end it begins there
    assert desk.commands.now.take is not None and desk.commands.now.take.duration_s == pytest.approx(3.0)
    with pytest.raises(ParameterError, match="no recording to lay"):
        Desk().play.layer(take())


def test_editing_another_recording_begins_at_its_start() -> None:
    desk = Desk(keys())
    desk.play.position_s, desk.play.range_s, desk.play.selected = 2.0, (0.0, 1.0), 1
    desk.play.toggle()
    desk.play.edit(take())
    assert (desk.play.position_s, desk.play.range_s, desk.play.selected, desk.play.playing) == (0.0, None, None, False)
    desk.play.edit(None)
    assert desk.commands.now.take is None


@pytest.mark.parametrize("recorded", [True, False])
def test_what_is_saved_is_loaded_again(recorded: bool, tmp_path: Path) -> None:
    known = Vocabulary.load(PARAMETERS)
    desk = Desk(keys(), take() if recorded else None)
    path = desk.play.save(tmp_path, " mine/../hello ", known, loop=True)
    assert path == tmp_path / ("hello.csv" if recorded else "hello.toml")
    other = Desk()
    other.play.position_s, other.play.selected, other.play.range_s = 1.0, 1, (0.0, 1.0)
    other.play.load(path)
    assert (other.play.position_s, other.play.selected, other.play.range_s) == (0.0, None, None)
    if recorded:
        found = other.commands.now.take
        assert found is not None and load_take(path, PARAMETERS).duration_s == found.duration_s
        np.testing.assert_allclose(found.values[:, SMILE], take().values[:, SMILE], atol=1e-4)
    else:
        assert other.commands.now.timeline.keys == keys().keys == load_timeline(path, PARAMETERS).keys
        assert "loop_s = 3.04" in path.read_text()
    assert desk.play.save(tmp_path, "  ", known, loop=False).stem == "mine"


def test_a_show_without_keys_is_not_edited(tmp_path: Path) -> None:
    path = tmp_path / "plain.toml"
    path.write_text('name = "plain"\nsteps = ["0.0 SET jawOpen 1"]\n')
    desk = Desk(keys())
    with pytest.raises(ParameterError, match="without keys"):
        desk.play.load(path)
    assert desk.commands.now.timeline == keys() and math.isclose(desk.play.length_s, 3.0)
