"""drivers.servos.port: a port knows when the wire is free, who owes an answer, and who is talking."""

from __future__ import annotations

import pytest

from drivers.base.errors import DriverError
from drivers.servos.port import Port
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import SERVOS


@pytest.fixture
def port() -> Port:
    return Port(VirtualBus(SERVOS).link, margin_s=0.01)  # type: ignore[arg-type]


def test_a_reply_is_awaited_from_when_all_that_was_sent_has_left(port: Port) -> None:
    port.openPort()
    begin_s = port.clock()
    port.transmit(bytes(100))
    port.transmit(bytes(50))
    port.expect(20)
    assert port.deadline_s - begin_s == pytest.approx(170 * 10 / port.baudrate + 0.01)


def test_opening_forgets_who_owed_an_answer_and_who_was_talking(port: Port) -> None:
    port.openPort()
    port.suspects.add(3)
    port.is_using = True
    with pytest.raises(DriverError, match="two threads"):
        port.is_using = True
    port.openPort()
    assert (port.suspects, port.is_using) == (set(), False)


def test_another_path_is_used_from_the_next_opening_on(port: Port) -> None:
    port.setPortName("elsewhere")
    assert port.link.path == port.port_name == "elsewhere"
