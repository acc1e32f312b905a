"""controller.tools.monitor over simulated servos: what is there is shown, and nothing is touched."""

from __future__ import annotations

import io
import os
import struct
import sys
from collections.abc import Callable

import pytest
from rich.console import Console

from controller.tools.monitor import KEPT, BusView, listen_to_bus, poll_servos, table_of
from drivers.base.errors import NoReply, PortMissing
from drivers.core.traffic import Decoder2
from drivers.packets.packet import encode_instruction, encode_status
from drivers.sim import SimulatedBus
from drivers.tables.tables import load_table

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")


def times(count: int) -> Callable[[], bool]:
    steps = iter([True] * count)
    return lambda: next(steps, False)


@pytest.mark.parametrize(
    ("model", "protocol", "read"), [("xl330-m288", 2, "Present Position"), ("sts3215", 1, "Present Position")]
)
def test_servos_are_asked_and_left_alone(model: str, protocol: int, read: str) -> None:
    out = io.StringIO()
    with SimulatedBus([1, 4], model=model) as bus:
        poll_servos(bus.path, 1_000_000, protocol, Console(file=out, width=200), times(8), 100.0)
        assert all(not bus.servo(i).torque and bus.servo(i).eeprom_writes == {} for i in (1, 4))
    text = out.getvalue()
    assert f"{read} = 2048" in text
    assert "write" not in text
    assert " 4 " in text


def test_a_terminal_shows_one_row_a_servo() -> None:
    out = io.StringIO()
    with SimulatedBus([1, 4]) as bus:
        bus.servo(4).place(2048 + 1024)
        poll_servos(bus.path, 1_000_000, 2, Console(file=out, force_terminal=True, width=140), times(40), 100.0)
    assert "90.0" in out.getvalue()


def test_nobody_there_is_told() -> None:
    with SimulatedBus([1], baud=57_600) as bus, pytest.raises(NoReply, match="1000000 baud") as caught:
        poll_servos(bus.path, 1_000_000, 2, Console(file=io.StringIO()), times(1), 10.0)
    assert "omote scan" in caught.value.hint


@pytest.mark.parametrize(
    ("model", "told"), [("", "4 bytes at 132: d2 04 00 00"), ("xl330-m288", "Present Position = 1234")]
)
def test_listening_says_nothing_and_tells_both_ends_apart(model: str, told: str) -> None:
    out = io.StringIO()
    master, slave = os.openpty()
    os.set_blocking(master, False)
    name = os.ttyname(slave)
    steps = times(4)

    def going() -> bool:
        os.write(master, encode_instruction(3, 2, struct.pack("<HH", 132, 4)))
        os.write(master, encode_status(3, 0, struct.pack("<i", 1234)))
        return steps()

    listen_to_bus(name, 1_000_000, 2, Console(file=out, width=120), going, model)
    with pytest.raises(BlockingIOError):
        os.read(master, 1)
    os.close(master)
    os.close(slave)
    assert "-> 3 read" in out.getvalue()
    assert f"<- 3 {told}" in out.getvalue()


def test_a_missing_port_is_one_error() -> None:
    with pytest.raises(PortMissing):
        listen_to_bus("/dev/not-there", 1_000_000, 2, Console(file=io.StringIO()), times(1))


WRITE = encode_instruction(3, 3, struct.pack("<HI", 116, 2048))


def watch(console: Console | None = None, lines: int = 16) -> BusView:
    decoder = Decoder2({3: load_table("xl330-m288")})
    rows = [{"id": 3, "position": 2047.0, "torque": True, "age": float("nan")}]
    return BusView("simulated bus", lambda: rows, decoder, console or Console(file=io.StringIO()), lines)


def shown(view: BusView, width: int = 100) -> str:
    """One refresh of a terminal."""
    screen = io.StringIO()
    asked = iter([True, False])
    view._console = Console(file=screen, force_terminal=True, width=width)
    view.run(lambda: next(asked))
    return screen.getvalue()


def test_bytes_become_lines_with_their_time() -> None:
    view = watch()
    view.tap(True, WRITE[:5])
    view.tap(True, WRITE[5:])
    (line,) = view.lines()
    assert line.split(maxsplit=1)[1] == "-> 3 write Goal Position = 2048"
    assert view.lines() == []


def test_without_a_terminal_lines_are_printed_once() -> None:
    out = io.StringIO()
    view = watch(Console(file=out))
    view.tap(True, WRITE)
    asked = iter([True, True, False])
    view.run(lambda: next(asked))
    assert out.getvalue().count("write Goal Position = 2048") == 1


def test_a_terminal_shows_servos_and_the_last_lines_only() -> None:
    view = watch(lines=2)
    for _ in range(5):
        view.tap(True, WRITE)
    screen = shown(view)
    assert "simulated bus" in screen
    assert screen.split("simulated bus")[-1].count("write Goal Position") <= 2
    assert "2047.0" in screen


def test_a_bus_that_is_faster_than_the_view_is_told() -> None:
    view = watch()
    for _ in range(KEPT + 7):
        view.tap(True, WRITE)
    assert "7 pieces left out" in shown(view)


def test_tables_take_any_columns_and_leave_unknown_cells_empty() -> None:
    table = table_of([{"id": 1, "torque": False}, {"id": 2, "load": 0.25}])
    assert [column.header for column in table.columns] == ["id", "torque", "load"]
    assert [list(column.cells) for column in table.columns] == [["1", "2"], ["off", ""], ["", "0.2"]]
