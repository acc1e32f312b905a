"""Servos on a line without a wire: a test writes their registers at times that it chooses."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.testing.records import ServoRecord

START_S = 100.0
"""When the record begins, by the line's clock."""


class Line:
    """Servos with ids 1 and on, and their record; times of its methods are seconds since the record began."""

    def __init__(self, *models: str) -> None:
        made = [SimulatedServo(k, model, now_s=START_S) for k, model in enumerate(models or ("xl330-m288",), 1)]
        self.chain = Chain(made, START_S)
        self.record = ServoRecord(self.chain, START_S)

    def write(self, servo: int, name: str, value: int, time_s: float) -> None:
        """Write a register as a packet does."""
        one = self.chain.servo(servo)
        item = one.table[name]
        self.record.before(START_S + time_s)
        one.write(item.address, value.to_bytes(item.size, "little", signed=value < 0), START_S + time_s)
        self.record.after(START_S + time_s)

    def settle(self, time_s: float) -> float:
        """What happened by itself until a time; returns that time by the line's clock."""
        self.chain.catch_up(START_S + time_s)
        self.record.notice(START_S + time_s)
        return START_S + time_s


def said(check: Callable[[], object]) -> str:
    """What an assertion says."""
    with pytest.raises(AssertionError) as error:
        check()
    return str(error.value)
