"""Monitors a bus in operation: its servos, their states and the packets on it. Enables no torque and moves nothing."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from controller.tools.scan import scan_port
from controller.tools.tables import fit_table
from controller.tools.traffic_files import TrafficWriter, combine_taps, decoder_of, read_traffic
from drivers import open_bus
from drivers.base.bus import Bus, BusState, ServoInfo, ServoSpec
from drivers.base.errors import DriverError, NoReply, PortLost
from drivers.core.traffic import Decoder, Decoder1, Decoder2
from drivers.core.trafficlog import Wire
from drivers.port.serialport import SerialPort, tapped
from drivers.tables.tables import FEETECH, ControlTable, load_table

SHOWN_REGISTERS = ("Present Position", "Goal Position")
READ_TIMEOUT_S = 0.1
Rows = Callable[[], Iterable[Mapping[str, Any]]]

REFRESH_S = 0.1
MAX_PIECES = 4096
"""Pieces of traffic kept between two refreshes. Beyond it the oldest are dropped, and the view shows how many."""


def make_decoder(protocol: int, tables: Mapping[int, ControlTable], model: str = "") -> Decoder:
    """Return a decoder with the registers of servos by id; a servo without a table is decoded as ``model``.

    Raises DriverError: no such model.
    """
    default = load_table(model) if model else None
    return Decoder1(tables, default) if protocol == 1 else Decoder2(tables, default)


def replay_traffic(path: Path, protocol: int | None, console: Console, model: str = "") -> None:
    """Print a record of traffic, decoded. ``protocol``, ``model`` : override those of the record.

    Raises ConfigError: it cannot be read. DriverError: no such model.
    """
    record = read_traffic(path)
    decoder = decoder_of(record, protocol, model)
    for piece in record.pieces:
        for line in decoder.feed(piece.sent, piece.data):
            console.print(Text(f"{piece.time_s:9.3f}  {line}"), soft_wrap=True)


def listen_to_bus(
    port: str,
    baud: int,
    protocol: int | None,
    console: Console,
    keep_going: Callable[[], bool],
    model: str = "",
    record: Path | None = None,
) -> None:
    """Show the traffic of a bus without sending a byte: an adapter that only receives is enough.

    ``protocol`` : if None, that of ``model``, or 2 if ``model`` is empty, too.
    ``model`` : names the registers of servos whose model does not appear in the traffic; may be empty.
    ``record`` : file for the traffic, or None.
    Raises PortError, DriverError when there is no such model, or ConfigError when the file cannot be written.
    """
    decoder = make_decoder(protocol or (load_table(model).protocol if model else 2), {}, model)
    view = BusView(f"listening on {port} at {baud} baud", lambda: _heard_rows(decoder), decoder, console)
    link = SerialPort(port, baud)
    link.open()
    wire = Wire("dynamixel", baud, model=model)
    with ExitStack() as stack:
        stack.callback(link.close)
        writer = stack.enter_context(TrafficWriter(record, wire)) if record else None

        def tap(sent: bool, data: bytes) -> None:
            view.tap(None, data)
            if writer is not None:
                writer.tap(None, data)

        link.tap = tap
        view.run(keep_going, lambda: link.read(time.monotonic() + READ_TIMEOUT_S))


def poll_servos(
    port: str,
    baud: int,
    protocol: int | None,
    console: Console,
    keep_going: Callable[[], bool],
    rate_hz: float,
    record: Path | None = None,
) -> None:
    """Find the servos on a port, then read their states at a rate and show them with all traffic.

    ``protocol`` : None tries 2, then 1, and uses the first in which servos answer.
    ``record`` : file for the traffic, or None.
    Raises PortError, NoReply when no servo answers, or ConfigError when the file cannot be written.
    """
    protocol, found = _find_servos(port, baud, (2, 1) if protocol is None else (protocol,))
    tables: dict[int, ControlTable] = {}
    for info in found:
        with suppress(DriverError):  # an unknown model is shown by addresses
            tables[info.id] = load_table(info.model_number, info.firmware)
    known = [info for info in found if info.id in tables]
    if not known:
        which = f": {', '.join(info.model for info in found)} cannot be read" if found else ""
        raise NoReply(f"no servo to ask on {port} at {baud} baud{which}", hint=f"omote scan {port}", port=port)
    decoder = make_decoder(protocol, tables)
    view = BusView(f"{port} at {baud} baud", lambda: (), decoder, console)
    kind = "feetech" if known[0].model.startswith(FEETECH) else "dynamixel"
    specs = [ServoSpec(info.id, f"servo {info.id}", info.model, -math.pi, math.pi, 1.0, 1.0) for info in known]
    wire = Wire(kind, baud, {info.id: tables[info.id].model for info in known})
    with ExitStack() as stack:
        writer = stack.enter_context(TrafficWriter(record, wire)) if record else None
        with tapped(combine_taps(view.tap, *([writer.tap] if writer else []))):
            bus = stack.enter_context(open_bus(kind, specs, port=port, baud=baud))
        reader = _Reader(bus, 1.0 / rate_hz)
        view.rows = reader.rows
        view.run(keep_going, reader.step)


def _find_servos(port: str, baud: int, protocols: Sequence[int]) -> tuple[int, list[ServoInfo]]:
    """Return the first protocol in which servos answer, and the servos; the last protocol and none if none answers."""
    for protocol in protocols:
        found = [item.servo for item in scan_port(port, [(protocol, baud)]) if item.servo]
        if found:
            break
    return protocol, found


class _Reader:
    """Reads a bus at a fixed rate and keeps the newest state."""

    def __init__(self, bus: Bus, period_s: float) -> None:
        self._bus, self._period_s = bus, period_s
        self._state: BusState | None = None
        self._next_s = time.monotonic()

    def step(self) -> None:
        """Wait until a read is due, and read; if the port is lost, reconnect."""
        time.sleep(max(0.0, self._next_s - time.monotonic()))
        self._next_s = max(self._next_s + self._period_s, time.monotonic())
        try:
            self._state = self._bus.read()
        except PortLost:
            self._next_s = time.monotonic() + 1.0
            try:
                self._bus.reconnect()
            except DriverError:
                self._state = None

    def rows(self) -> list[dict[str, Any]]:
        """Return one row for each servo."""
        state = self._state
        if state is None:
            return [{"id": servo.id, "model": servo.model, "state": "port lost"} for servo in self._bus.servos]
        degrees = np.degrees(state.position_rad)
        return [
            {
                "id": servo.id,
                "model": servo.model,
                "position deg": float(degrees[i]),
                "speed deg/s": float(np.degrees(state.velocity_rad_s[i])),
                "current A": "" if math.isnan(state.current_a[i]) else f"{state.current_a[i]:.3f}",
                "supply V": float(state.voltage_v[i]),
                "temp. C": float(state.temperature_c[i]),
                "torque": bool(state.torque[i]),
                "state": _state(state, i),
            }
            for i, servo in enumerate(self._bus.servos)
        ]


def _state(state: BusState, i: int) -> str:
    if state.silent[i]:
        return "silent"
    if state.hardware_error[i]:
        return f"hardware error 0x{int(state.hardware_error[i]):02x}"
    return "" if state.fresh[i] else f"{state.age_s[i]:.1f} s old"


def _heard_rows(decoder: Decoder) -> list[dict[str, Any]]:
    """Return one row for each servo whose answers were received."""
    return [
        {"id": servo, "answers": record.packets, "error": record.error}
        | {name: record.values[name] for name in SHOWN_REGISTERS if name in record.values}
        for servo, record in sorted(decoder.heard.items())
    ]


class BusView:
    """Shows the traffic of a bus and the state of its servos.

    ``tap`` may be called from any thread and only stores the bytes; decoding and drawing happen in :meth:`run`.

    title : of the view. rows : returns one mapping for each servo, values by column. decoder : of the bus's protocol.
    console : to print to; if it is not a terminal, lines are printed as they arrive. lines : lines of traffic shown.
    """

    def __init__(self, title: str, rows: Rows, decoder: Decoder, console: Console, lines: int = 16) -> None:
        self.title, self.rows, self._decoder, self._console = title, rows, decoder, console
        self._pieces: deque[tuple[float, bool | None, bytes]] = deque(maxlen=MAX_PIECES)
        self._log: deque[str] = deque(maxlen=lines)
        self._begun_s = time.monotonic()
        self._taken = self._passed = 0

    def tap(self, sent: bool | None, data: bytes) -> None:
        """Store bytes that passed; ``sent`` is None if the direction is not known."""
        self._passed += 1
        self._pieces.append((time.monotonic(), sent, bytes(data)))

    def lines(self) -> list[str]:
        """Decode the stored bytes; return the new lines, each with the time since the beginning."""
        new = []
        while self._pieces:
            time_s, sent, data = self._pieces.popleft()
            self._taken += 1
            new += [f"{time_s - self._begun_s:9.3f}  {line}" for line in self._decoder.feed(sent, data)]
        return new

    def run(self, keep_going: Callable[[], bool], step: Callable[[], object] = lambda: time.sleep(REFRESH_S)) -> None:
        """Show the view until ``keep_going()`` is false; calls ``step``, which waits a moment, in a loop."""
        if self._console.is_terminal:
            with Live(self._picture(), console=self._console, auto_refresh=False, screen=True) as live:
                self._loop(keep_going, step, lambda: live.update(self._picture(), refresh=True))
        else:
            self._loop(keep_going, step, self._print)
            self._print()

    def _loop(self, keep_going: Callable[[], bool], step: Callable[[], object], show: Callable[[], None]) -> None:
        next_s = 0.0
        while keep_going():
            step()
            if time.monotonic() >= next_s:
                show()
                next_s = time.monotonic() + REFRESH_S

    def _print(self) -> None:
        for line in self.lines():
            self._console.print(Text(line), soft_wrap=True)

    def _picture(self) -> Group:
        self._log.extend(self.lines())
        left_out = self._passed - self._taken - len(self._pieces)
        note = f"  ({left_out} pieces left out)" if left_out > 0 else ""
        title = Text(f"{self.title}   Ctrl-C ends{note}", style="bold")
        servos = fit_table(table_of(self.rows()), self._console, self._console.width)
        return Group(title, *servos, Text("\n".join(self._log), overflow="fold"))


def table_of(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Return mappings as a table; missing and NaN values stay empty."""
    found = list(rows)
    names = list(dict.fromkeys(name for row in found for name in row))
    table = Table(*names, box=None, pad_edge=False)
    for row in found:
        table.add_row(*(_cell(row.get(name)) for name in names))
    return table


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.1f}" if isinstance(value, float) else str(value)
