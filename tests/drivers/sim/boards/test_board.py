"""drivers.sim.boards.board: brown-out, faults of answers, and pulses that move to their targets."""

from __future__ import annotations

import pytest

from drivers.sim.boards.board import RcChannel


def at(position: float) -> RcChannel:
    channel = RcChannel()
    channel.go(position, 0.0)
    return channel


def test_the_first_target_is_put_out_at_once_whatever_the_limits():
    channel = RcChannel()
    assert channel.position(0.0) == 0.0
    channel.go(1500.0, 1.0, speed=10.0, acceleration=10.0)
    assert channel.position(1.0) == 1500.0
    assert not channel.moving(1.0)


def test_without_limits_it_jumps():
    channel = at(1000.0)
    channel.go(2000.0, 1.0)
    assert channel.position(1.0) == 2000.0


def test_speed_and_acceleration():
    channel = at(1000.0)
    channel.go(1500.0, 1.0, speed=100.0)
    assert channel.position(2.0) == pytest.approx(1100.0)
    assert channel.moving(5.9)
    assert not channel.moving(6.1)
    channel = at(1000.0)
    channel.go(2000.0, 0.0, speed=100.0, acceleration=50.0)
    assert channel.position(1.0) == pytest.approx(1025.0)
    assert channel.position(3.0) == pytest.approx(1200.0)
    channel = at(1000.0)
    channel.go(1100.0, 0.0, acceleration=100.0)
    assert channel.position(1.0) == pytest.approx(1050.0)
    assert channel.position(2.0) == pytest.approx(1100.0)


def test_off_forgets_where_it_was():
    channel = at(1000.0)
    channel.go(0.0, 1.0, speed=1.0)
    assert (channel.position(2.0), channel.moving(2.0)) == (0.0, False)
    channel.go(1800.0, 2.0, speed=1.0)
    assert channel.position(2.0) == 1800.0


def test_a_move_in_a_given_time():
    channel = at(1000.0)
    channel.go_in(1500.0, 1.0, 2.0)
    assert channel.position(2.0) == pytest.approx(1250.0)
    channel.go_in(1000.0, 2.0, 0.0)
    assert channel.position(2.0) == 1000.0
    other = RcChannel()
    other.go_in(1500.0, 0.0, 9.0)
    assert other.position(0.0) == 1500.0
    other.go_in(0.0, 1.0, 9.0)
    assert other.position(1.0) == 0.0
