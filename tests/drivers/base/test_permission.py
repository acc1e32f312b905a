"""drivers.base.permission: where ports are forbidden nothing opens one, whoever asks for it and however."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest

from controller.body.preload import PreloadedBody
from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.children import command
from drivers.base.errors import PortError
from drivers.base.permission import check_ports_allowed, ports_forbidden
from drivers.port.serialport import SerialPort

KINDS = {"dynamixel": "xl330-m288", "feetech": "sts3215"} | dict.fromkeys(("maestro", "ssc32", "text"), "rc-90")
JAW = ServoSpec(1, "jaw", "xl330-m288", -0.5, 0.5, 5.0, 50.0)


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: the descriptor of its far end, and its path."""
    far, near = os.openpty()
    os.set_blocking(far, False)
    yield far, os.ttyname(near)
    os.close(far)
    os.close(near)


def test_ports_are_allowed_until_they_are_forbidden_and_afterwards(terminal: tuple[int, str]) -> None:
    port = SerialPort(terminal[1])
    port.open()
    port.close()
    with ports_forbidden("a dry run"), pytest.raises(PortError, match=f"a dry run does not open port {terminal[1]}"):
        port.open()
    port.open()
    port.close()


def test_the_inner_of_two_reasons_ends_first() -> None:
    with ports_forbidden("a dry run"):
        with ports_forbidden("a check"), pytest.raises(PortError, match="a check does not move"):
            check_ports_allowed("move")
        with pytest.raises(PortError, match="a dry run does not move"):
            check_ports_allowed("move")
    check_ports_allowed("move")


@pytest.mark.parametrize("url", ["socket://127.0.0.1:9", "memory://nowhere", "loop://", "/dev/ttyUSB0"])
def test_no_kind_of_port_is_opened(url: str) -> None:
    with ports_forbidden("a dry run"), pytest.raises(PortError, match="a dry run does not open"):
        SerialPort(url).open()


@pytest.mark.parametrize("kind", KINDS)
def test_no_driver_sends_a_byte(kind: str, terminal: tuple[int, str]) -> None:
    far, path = terminal
    options = {"template": "{ch}:{us}\n"} if kind == "text" else {}
    bus = open_bus(kind, [replace(JAW, model=KINDS[kind])], port=path, **options)
    with ports_forbidden("a dry run"), pytest.raises(PortError, match="a dry run does not open"), bus:
        bus.start()
    with pytest.raises(BlockingIOError):
        os.read(far, 1)


def test_threads_are_no_way_around(terminal: tuple[int, str]) -> None:
    raised: list[Exception] = []

    def work() -> None:
        try:
            SerialPort(terminal[1]).open()
        except PortError as error:
            raised.append(error)

    with ports_forbidden("a dry run"):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert len(raised) == 1


def test_processes_that_could_open_one_are_not_started() -> None:
    with ports_forbidden("a dry run"):
        with pytest.raises(PortError, match=r"a dry run does not start drivers\.core\.dead_man_switch"):
            command("drivers.core.dead_man_switch")
        with pytest.raises(PortError, match="a dry run does not start the process that drives the servos"):
            PreloadedBody()
        with pytest.raises(PortError, match="a dry run does not"):
            open_bus("simulated", [JAW]).open()
