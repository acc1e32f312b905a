"""controller.takes.timeline: keys become a show that the body's own player plays, and are read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line.script import load_script
from controller.links.line.show import Show
from controller.takes.timeline import (
    EASES,
    Key,
    Timeline,
    ease_fraction,
    key_of_face,
    load_timeline,
    save_show,
    steps_of,
)

JAW, SMILE = P.index("jawOpen"), P.index("mouthSmileLeft")


def example() -> Timeline:
    timeline = Timeline().with_key(Key(2.0, {"jawOpen": 0.0, "mouthSmileLeft": 1.0}, "linear"))
    return timeline.with_key(Key(0.0, {}, name="rest")).with_key(Key(1.0, {"jawOpen": 0.8}, "smooth"))


def test_the_face_goes_from_key_to_key() -> None:
    timeline = example()
    assert [key.at_s for key in timeline.keys] == [0.0, 1.0, 2.0] and timeline.length_s == 2.0
    at = lambda time_s: timeline.at(time_s, P)[[JAW, SMILE]].tolist()  # noqa: E731
    assert at(0.0) == [0.0, 0.0] and at(1.0) == [0.8, 0.0] and at(9.0) == [0.0, 1.0] and at(-1.0) == [0.0, 0.0]
    assert at(0.5) == pytest.approx([0.4, 0.0]) and at(0.25)[0] < 0.2 and at(1.5) == pytest.approx([0.4, 0.5])
    assert Timeline().at(1.0, P).tolist() == P.neutral().tolist()


def test_every_ease_begins_and_ends_where_it_shall() -> None:
    for ease in EASES:
        assert (ease_fraction(0.0, ease), ease_fraction(1.0, ease)) == (0.0, 1.0)
        ways = [ease_fraction(share, ease) for share in np.linspace(0, 1, 101)]
        assert np.all(np.diff(ways) >= 0.0)
    assert ease_fraction(0.5, "in") < 0.5 < ease_fraction(0.5, "out") and ease_fraction(0.99, "hold") == 0.0


def test_edits_leave_the_earlier_timeline_as_it_was() -> None:
    first = example()
    second = first.with_time(1, 1.5).with_ease(1, "hold").with_mark("hello", 0.5)
    assert [key.at_s for key in first.keys] == [0.0, 1.0, 2.0] and not first.marks
    assert [(key.at_s, key.ease) for key in second.keys] == [(0.0, "smooth"), (1.5, "hold"), (2.0, "linear")]
    assert second.with_mark("hello", None).marks == {} and len(second.without_key(0).keys) == 2
    assert len(first.with_key(Key(1.0, {"jawOpen": 0.1})).keys) == 3  # in place of the other
    for wrong in (lambda: first.with_key(Key(-1.0, {})), lambda: first.with_mark(" ", 0.0)):
        with pytest.raises(ParameterError):
            wrong()


def test_a_saved_timeline_is_a_show_that_plays_it(tmp_path: Path) -> None:
    path, timeline = tmp_path / "hello.toml", example().with_mark("smile", 1.5)
    save_show(path, timeline, P, loop=True)
    assert load_timeline(path, P) == timeline
    script = load_script(str(path), P)
    assert script.marks == {"smile": 1.5} and script.loop_s > 2.0
    state, out, errors = CommandState(P), P.neutral(), []
    show = Show(script, state)
    show.playing = True
    for tick in range(1, 230):
        show.tick(tick * 10_000_000)
        held = state.held()
        if tick <= 200:
            wanted = timeline.at((tick - 1) / 100, P)
            errors.append(max(abs(held.get(i, 0.0) - wanted[i]) for i in (JAW, SMILE)))
        state.tick(tick * 10_000_000, 0.01, out)
    assert max(errors) < 0.06  # of 25 steps a second
    assert show.position_s < 0.5  # it has begun again


def test_steps_say_only_what_changes() -> None:
    still = Timeline().with_key(Key(0.0, {"jawOpen": 0.5})).with_key(Key(10.0, {"jawOpen": 0.5}))
    assert steps_of(still, P) == ["0.000 SET jawOpen 0.5"]
    assert steps_of(Timeline(), P) == []


def test_a_key_between_two_steps_has_a_step_of_its_own() -> None:
    timeline = Timeline((Key(0.0, {"jawOpen": 0.0}, "linear"), Key(0.123, {"jawOpen": 1.0}, "linear")))
    assert steps_of(timeline, P, 10.0)[-1] == "0.123 SET jawOpen 1"


def test_what_cannot_be_saved_or_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no keys"):
        save_show(tmp_path / "a.toml", Timeline(), P)
    assert not (tmp_path / "a.toml").exists()
    (tmp_path / "b.toml").write_text("steps = []\n[[keys]]\nat_s = 1.0\nvalues = { nose = 1.0 }\n")
    with pytest.raises(ConfigError, match="nose"):
        load_timeline(tmp_path / "b.toml", P)


def test_a_key_of_a_face_has_what_moves() -> None:
    face = P.neutral()
    face[JAW], face[SMILE] = 0.25, 1e-4
    assert key_of_face(1.23456, face, P, "out", "ah") == Key(1.235, {"jawOpen": 0.25}, "out", "ah")
