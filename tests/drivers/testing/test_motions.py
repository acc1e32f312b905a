"""The path of a shaft from pieces of its motion: where it was, and where it was faster than allowed."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from drivers.testing.motions import SAMPLES, Sample, dashes, path, paths, place_at
from drivers.testing.records import Piece


class State(NamedTuple):
    """What a trajectory says of a moment."""

    position: float
    velocity: float
    acceleration: float


def moving(start_s: float, seconds: float, place: Callable[[float], float], speed: Callable[[float], float]) -> Any:
    """A trajectory by its place and speed after so many seconds; it stands from its end on."""

    def at(time_s: float) -> State:
        t = min(max(time_s - start_s, 0.0), seconds)
        return State(place(t), speed(t) if t < seconds else 0.0, 0.0)

    return SimpleNamespace(start_s=start_s, duration=seconds, at=at)


def line(start_s: float, seconds: float, speed: float, begin: float = 0.0) -> Any:
    return moving(start_s, seconds, lambda t: begin + speed * t, lambda t: speed)


def piece(trajectory: Any, start_s: float | None = None, *, jammed: float | None = None, powered: bool = True) -> Piece:
    return Piece(trajectory.start_s if start_s is None else start_s, trajectory, jammed, powered)


def test_a_motion_is_sampled_evenly_until_it_stands() -> None:
    samples = path(piece(line(10.0, 2.0, 50.0, 7.0)), 20.0)
    assert len(samples) == SAMPLES + 1
    assert (samples[0].time_s, samples[-1].time_s) == (10.0, 12.0)
    assert [s.position for s in samples] == pytest.approx([7.0 + 50.0 * (s.time_s - 10.0) for s in samples])
    assert samples[1].time_s - samples[0].time_s == pytest.approx(2.0 / SAMPLES)
    cut = path(piece(line(10.0, 2.0, 50.0)), 11.0)  # the next piece begins in its middle
    assert cut[-1].time_s == 11.0 and cut[-1].position == pytest.approx(50.0) and cut[-1].velocity == 50.0


def test_a_shaft_that_stands_has_one_sample() -> None:
    assert path(piece(line(10.0, 2.0, 50.0), 13.0), 20.0) == [Sample(13.0, 100.0, 0.0)]
    assert path(piece(line(10.0, 2.0, 50.0), 10.5, jammed=3.0), 20.0) == [Sample(10.5, 3.0, 0.0)]
    assert path(piece(line(10.0, 2.0, 50.0), 9.0, jammed=3.0), 20.0) == [Sample(10.0, 3.0, 0.0)]
    assert path(piece(line(10.0, 2.0, 50.0), 11.0), 11.0) == [Sample(11.0, 50.0, 50.0)]  # the next begins at once


def test_each_piece_ends_where_the_next_begins() -> None:
    pieces = [piece(line(0.0, 9.0, 1.0)), piece(line(2.0, 9.0, 2.0)), piece(line(3.0, 0.5, 4.0))]
    found = [(own, samples[0].time_s, samples[-1].time_s) for own, samples in paths(pieces, 8.0)]
    assert found == [(pieces[0], 0.0, 2.0), (pieces[1], 2.0, 3.0), (pieces[2], 3.0, 3.5)]


def test_a_place_is_that_of_the_piece_at_its_time() -> None:
    pieces = [piece(line(0.0, 9.0, 1.0)), piece(line(2.0, 9.0, 2.0, 50.0)), piece(line(3.0, 1.0, 4.0), jammed=-7.0)]
    assert [place_at(pieces, t) for t in (-1.0, 1.5, 2.0, 2.5, 3.0, 9.0)] == [0.0, 1.5, 50.0, 51.0, -7.0, -7.0]


def test_only_what_is_faster_under_power_is_a_dash() -> None:
    rise = moving(0.0, 2.0, lambda t: 50.0 * t * t, lambda t: 100.0 * t)  # from 0 to 200 ticks/s
    (dash,) = dashes([piece(rise)], 9.0, 100.0)
    assert dash.first.time_s == pytest.approx(1.0, abs=0.07) and dash.first.velocity > 100.0
    assert dash.last == Sample(2.0, 200.0, 0.0)  # with the sample at which it is slow again
    assert dash.top_speed == pytest.approx(200.0 * (SAMPLES - 1) / SAMPLES)
    assert dash.way == pytest.approx(200.0 - dash.first.position)
    assert dashes([piece(rise, powered=False)], 9.0, 100.0) == []
    assert dashes([piece(rise)], 9.0, 200.0) == []
    back = piece(line(0.0, 2.0, -150.0))
    assert dashes([back], 1.0, 100.0)[0].top_speed == 150.0 and dashes([back], 1.0, 100.0)[0].way > 140.0


def test_dashes_go_on_over_pieces_and_end_without_power() -> None:
    one, two = piece(line(0.0, 9.0, 200.0)), piece(line(1.0, 9.0, 300.0, 200.0))
    slow, limp = piece(line(2.0, 9.0, 10.0)), piece(line(2.0, 9.0, 400.0), powered=False)
    (joined,) = dashes([one, two, slow], 9.0, 100.0)
    assert (
        joined.first.time_s == 0.0 and joined.top_speed == 300.0 and joined.last.time_s == pytest.approx(2.0, abs=0.3)
    )
    (ended,) = dashes([one, two, limp], 9.0, 100.0)
    assert ended.last.time_s == 2.0 and ended.last.velocity == 300.0
    assert len(dashes([one, slow, piece(line(4.0, 9.0, 200.0))], 5.0, 100.0)) == 2
