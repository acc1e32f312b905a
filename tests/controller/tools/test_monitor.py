"""controller.tools.monitor over simulated servos: what is there is shown, and nothing is touched."""

from __future__ import annotations

import io
import math
import os
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rich.console import Console

from controller.tools import monitor as module
from controller.tools.monitor import (
    MAX_PIECES,
    BusView,
    listen_to_bus,
    make_decoder,
    poll_servos,
    replay_traffic,
    table_of,
)
from drivers.base.bus import BusState
from drivers.base.errors import DriverError, NoReply, PortLost, PortMissing
from drivers.core.traffic import Decoder1, Decoder2
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


@pytest.mark.parametrize(
    ("protocol", "model", "wanted"),
    [(None, "", 2), (None, "ax-12a", 1), (None, "xl330-m288", 2), (1, "", 1), (2, "", 2)],
)
def test_who_names_no_protocol_hears_that_of_the_model(
    monkeypatch: pytest.MonkeyPatch, protocol: int | None, model: str, wanted: int
) -> None:
    asked = []

    def make(protocol: int, tables: dict[int, Any], model: str) -> Any:
        asked.append((protocol, model))
        return make_decoder(protocol, tables, model)

    monkeypatch.setattr(module, "make_decoder", make)
    with pytest.raises(PortMissing):
        listen_to_bus("/dev/not-there", 1_000_000, protocol, Console(file=io.StringIO()), times(1), model)
    assert asked == [(wanted, model)]


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
    for _ in range(MAX_PIECES + 7):
        view.tap(True, WRITE)
    assert "7 pieces left out" in shown(view)


def test_tables_take_any_columns_and_leave_unknown_cells_empty() -> None:
    table = table_of([{"id": 1, "torque": False}, {"id": 2, "load": 0.25}])
    assert [column.header for column in table.columns] == ["id", "torque", "load"]
    assert [list(column.cells) for column in table.columns] == [["1", "2"], ["off", ""], ["", "0.2"]]


class Lossy:
    """A bus of two servos whose reads give, or raise, one thing after another."""

    servos = (SimpleNamespace(id=3, model="a"), SimpleNamespace(id=5, model="b"))

    def __init__(self, *results: object) -> None:
        self.results = list(results)
        self.reconnects: list[object] = []

    def read(self) -> object:
        found = self.results.pop(0)
        if isinstance(found, Exception):
            raise found
        return found

    def reconnect(self) -> None:
        self.reconnects.append(1)
        if isinstance(self.results[0], DriverError):
            raise self.results.pop(0)  # type: ignore[misc]


class Hands:
    """A clock that only sleeping moves on."""

    def __init__(self) -> None:
        self.now, self.sleeps = 10.0, list[float]()

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.sleeps.append(seconds)
        self.now += seconds


def state_of(**changes: object) -> BusState:
    none, no = np.zeros(2), np.zeros(2, bool)
    codes = np.zeros(2, np.uint8)
    plain = BusState(0.0, none, none, none, ~no, none, codes, no, none, none, codes, no)
    return replace(plain, **changes)  # type: ignore[arg-type]


def test_states_are_told_by_servo(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "time", Hands())
    state = state_of(
        position_rad=np.radians([90.0, -45.0]), velocity_rad_s=np.radians([10.0, 0.0]),
        current_a=np.array([0.12345, np.nan]), voltage_v=np.array([5.0, 4.5]), temperature_c=np.array([30.0, 31.0]),
        torque=np.array([True, False]),
    )  # fmt: skip
    reader = module._Reader(cast(Any, Lossy(state)), 0.1)
    assert reader.rows() == [
        {"id": 3, "model": "a", "state": "port lost"}, {"id": 5, "model": "b", "state": "port lost"}
    ]  # fmt: skip
    reader.step()
    first, second = reader.rows()
    assert first == pytest.approx(
        {"id": 3, "model": "a", "position deg": 90.0, "speed deg/s": 10.0, "current A": "0.123", "supply V": 5.0,
         "temp. C": 30.0, "torque": True, "state": ""}
    )  # fmt: skip
    assert second["position deg"] == pytest.approx(-45.0) and second["current A"] == "" and second["torque"] is False
    for changes, told in (
        ({"fresh": np.array([False, True]), "age_s": np.array([1.25, 9.0])}, ["1.2 s old", ""]),
        ({"silent": np.array([False, True]), "fresh": np.zeros(2, bool)}, ["0.0 s old", "silent"]),
        ({"hardware_error": np.array([0, 0x2C], np.uint8)}, ["", "hardware error 0x2c"]),
    ):
        reader = module._Reader(cast(Any, Lossy(state_of(**changes))), 0.1)
        reader.step()
        assert [row["state"] for row in reader.rows()] == told


def test_a_bus_is_read_at_its_rate_and_a_lost_port_tried_again_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    hands, state = Hands(), state_of()
    monkeypatch.setattr(module, "time", hands)
    lost = PortLost("gone", port="p")
    bus = Lossy(state, state, lost, NoReply("still gone", port="p"), lost, state, state)
    reader = module._Reader(cast(Any, bus), 0.25)
    reader.step()
    reader.step()
    assert hands.sleeps == [0.0, 0.25] and "position deg" in reader.rows()[0]
    reader.step()
    assert reader.rows()[0]["state"] == "port lost" and len(bus.reconnects) == 1
    reader.step()  # lost again, but it came back
    reader.step()
    assert hands.sleeps == [0.0, 0.25, 0.25, 1.0, 1.0] and len(bus.reconnects) == 2
    assert "position deg" in reader.rows()[0]
    hands.now += 5.0  # the reader was held up: what it missed is not made up for
    reader.step()
    assert hands.sleeps[-1] == 0.0


def test_what_was_heard_is_a_row_for_each_servo() -> None:
    decoder = Decoder2({3: load_table("xl330-m288")})
    decoder.feed(None, encode_instruction(3, 2, struct.pack("<HH", 132, 4)))
    decoder.feed(None, encode_status(3, 0, struct.pack("<i", 1234)))
    decoder.feed(None, encode_status(9, 0x80, b""))
    decoder.feed(None, encode_status(9, 0, b""))
    assert module._heard_rows(decoder) == [
        {"id": 3, "answers": 1, "error": decoder.heard[3].error, "Present Position": 1234},
        {"id": 9, "answers": 2, "error": decoder.heard[9].error},
    ]


def test_lines_are_shown_every_tenth_of_a_second_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    hands, out = Hands(), io.StringIO()
    view = watch(Console(file=out))
    monkeypatch.setattr(module, "time", hands)
    view._begun_s = 8.75
    counts: list[int] = []

    def step() -> None:
        counts.append(out.getvalue().count("write"))
        view.tap(True, WRITE)
        hands.now += 0.0625

    view.run(times(5), step)
    assert counts == [0, 1, 1, 3, 3]
    assert out.getvalue().count("write") == 5  # what was left is printed at the end
    assert out.getvalue().startswith("    1.250  -> 3 write Goal Position = 2048\n")


def test_cells_of_every_kind() -> None:
    table = table_of([{"a": None, "b": math.nan, "c": True, "d": False, "e": 1.25, "f": 7, "g": "x"}])
    assert [list(column.cells) for column in table.columns] == [[""], [""], ["on"], ["off"], ["1.2"], ["7"], ["x"]]
    assert table_of([]).columns == []


def test_a_view_shows_sixteen_lines_of_traffic() -> None:
    view = BusView("t", list, Decoder2({}), Console(file=io.StringIO()))
    for i in range(20):
        view.tap(True, encode_instruction(i + 1, 1))
    screen = shown(view)
    assert [f"-> {i} ping" in screen for i in range(3, 7)] == [False, False, True, True]


def test_decoders_are_of_their_protocol_and_know_a_usual_model() -> None:
    assert isinstance(make_decoder(1, {}), Decoder1) and isinstance(make_decoder(2, {}), Decoder2)
    with pytest.raises(DriverError):
        make_decoder(2, {}, "nothing")
    view = watch()
    assert view._log.maxlen == 16 and MAX_PIECES == 4096


@pytest.mark.parametrize(("model", "listen"), [("xl330-m288", False), ("sts3215", False), ("xl330-m288", True)])
def test_traffic_is_recorded_and_decoded_again(tmp_path: Path, model: str, listen: bool) -> None:
    live, again, path = io.StringIO(), io.StringIO(), tmp_path / "bus.log"
    with SimulatedBus([1, 4], model=model) as bus:
        console = Console(file=live, width=200)
        if listen:
            with os.fdopen(os.open(bus.path, os.O_RDWR | os.O_NOCTTY), "wb", buffering=0) as other:
                other.write(encode_instruction(4, 1))
                listen_to_bus(bus.path, 1_000_000, None, console, times(3), model, path)
        else:
            poll_servos(bus.path, 1_000_000, None, console, times(8), 100.0, path)
    replay_traffic(path, None, Console(file=again, width=200))
    shown, found = ([" ".join(line.split()[1:]) for line in out.getvalue().splitlines()] for out in (live, again))
    assert found == shown
    assert listen or any("Present Position" in line for line in found)
