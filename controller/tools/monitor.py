"""Monitors a working bus: its servos, their states and the packets that pass. Nothing is switched on or moved."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rich.console import Console

from controller.tools.monitor_view import BusView
from controller.tools.scan import scan_port
from drivers import open_bus
from drivers.base.bus import Bus, BusState, ServoInfo, ServoSpec
from drivers.base.errors import DriverError, NoReply, PortLost
from drivers.core.traffic import Decoder, Decoder1, Decoder2
from drivers.port.serialport import SerialPort, tapped
from drivers.tables.tables import ControlTable, load_table

FEETECH = ("sts", "scs")
SHOWN = ("Present Position", "Goal Position")
WAIT_S = 0.1


def decoder_of(protocol: int, found: Sequence[ServoInfo] = (), model: str = "") -> Decoder:
    """A decoder that knows the registers of the servos found, and takes all others for ``model``.

    Raises DriverError when there is no such model.
    """
    default = load_table(model) if model else None
    tables: dict[int, ControlTable] = {}
    for info in found:
        try:
            tables[info.id] = load_table(info.model_number, info.firmware)
        except DriverError:  # an unknown model is shown by addresses
            continue
    return Decoder1(tables, default) if protocol == 1 else Decoder2(tables, default)


def listen_to_bus(
    port: str, baud: int, protocol: int, console: Console, keep_going: Callable[[], bool], model: str = ""
) -> None:
    """Show the traffic of a bus without sending a byte: an adapter that only receives is enough.

    ``model`` : of servos whose model is not seen in the traffic, for the names of registers; may be empty.
    Raises PortError, or DriverError when there is no such model.
    """
    decoder = decoder_of(protocol, model=model)
    view = BusView(f"listening on {port} at {baud} baud", lambda: _heard_rows(decoder), decoder, console)
    link = SerialPort(port, baud)
    link.open()
    link.tap = lambda sent, data: view.tap(None, data)
    try:
        view.run(keep_going, lambda: _read_for_a_moment(link))
    finally:
        link.close()


def _read_for_a_moment(link: SerialPort) -> None:
    link.read(time.monotonic() + WAIT_S)


def poll_servos(
    port: str, baud: int, protocol: int, console: Console, keep_going: Callable[[], bool], rate_hz: float
) -> None:
    """Find the servos on a port, then read their states at a rate and show them with all traffic.

    Raises PortError, or NoReply when no servo answers.
    """
    found = [item.servo for item in scan_port(port, [(protocol, baud)]) if item.servo]
    known = [info for info in found if _is_known(info)]
    if not known:
        which = f": {', '.join(info.model for info in found)} cannot be asked" if found else ""
        raise NoReply(f"no servo to ask on {port} at {baud} baud{which}", hint=f"omote scan {port}", port=port)
    decoder = decoder_of(protocol, known)
    view = BusView(f"{port} at {baud} baud", lambda: (), decoder, console)
    kind = "feetech" if known[0].model.startswith(FEETECH) else "dynamixel"
    specs = [ServoSpec(info.id, f"servo {info.id}", info.model, -math.pi, math.pi, 1.0, 1.0) for info in known]
    with tapped(view.tap):
        bus = open_bus(kind, specs, port=port, baud=baud)
    with bus:
        reader = _Reader(bus, 1.0 / rate_hz)
        view.rows = reader.rows
        view.run(keep_going, reader.step)


def _is_known(info: ServoInfo) -> bool:
    try:
        load_table(info.model_number, info.firmware)
    except DriverError:
        return False
    return True


class _Reader:
    """Reads a bus at a fixed rate and keeps the newest state."""

    def __init__(self, bus: Bus, period_s: float) -> None:
        self._bus, self._period_s = bus, period_s
        self._state: BusState | None = None
        self._next_s = time.monotonic()

    def step(self) -> None:
        """Wait until a read is due, and read; a lost port is tried again."""
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
        """One row a servo."""
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
    """One row a servo whose answers were heard."""
    return [
        {"id": servo, "answers": heard.packets, "error": heard.error}
        | {name: heard.values[name] for name in SHOWN if name in heard.values}
        for servo, heard in sorted(decoder.heard.items())
    ]
