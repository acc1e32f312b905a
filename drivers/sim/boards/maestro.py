"""A simulated Pololu Maestro servo controller: compact, Pololu and Mini SSC protocol on one port.

Source: Pololu Maestro User's Guide, sections 3, 4.e and 5. Scripts are not run; their commands are accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from drivers.base.errors import DriverError
from drivers.base.options import option
from drivers.core.families import BOARD_BAUD
from drivers.core.traffic import HexDecoder
from drivers.sim.boards import maestro_guide as guide
from drivers.sim.boards.board import Board, RcChannel
from drivers.sim.boards.maestro_guide import MaestroError, crc7
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import BufferingReader
from drivers.sim.wire.simulator import Servos, Setting, Simulator

LIMITS_US = (992.0, 2000.0)
"""Pulse limits of a new board."""
_MINI_ONLY = (guide.SET_MULTIPLE, guide.GET_MOVING, guide.SET_PWM)

_LENGTHS = {
    guide.SET_TARGET: 3,
    guide.SET_SPEED: 3,
    guide.SET_ACCELERATION: 3,
    guide.SET_PWM: 4,
    guide.GET_POSITION: 1,
    guide.GET_MOVING: 0,
    guide.GET_ERRORS: 0,
    guide.GO_HOME: 0,
    guide.STOP_SCRIPT: 0,
    guide.RESTART_SCRIPT: 1,
    guide.RESTART_WITH_PARAMETER: 3,
    guide.SCRIPT_STATUS: 0,
    guide.MINI_SSC: 2,
}


class Command(NamedTuple):
    """One command of `size` bytes; `error` is set instead of `code` where the bytes make no sense."""

    code: int
    data: bytes
    size: int
    error: MaestroError | None = None


class MaestroReader(BufferingReader):
    """Cuts a byte stream into commands. An incomplete one is never given up (the time-out is off by default).

    device : device number; commands of the Pololu protocol to another are passed over.
    crc : each message of the compact and Pololu protocol ends with its CRC-7.
    """

    def __init__(self, device: int = 12, crc: bool = False) -> None:
        super().__init__()
        self._device, self._crc = device, crc

    def feed(self, data: bytes) -> list[Command]:
        return [command for byte in data for command in self._take(byte)]

    def _take(self, byte: int) -> list[Command]:
        """A byte of 0x80 and more begins a command, wherever it comes; only Mini SSC may carry it as data."""
        buffer, commands = self._buffer, []
        if byte >= 0x80 and not (buffer and buffer[0] == guide.MINI_SSC and byte != guide.MINI_SSC):
            if buffer and buffer != bytes((guide.POLOLU,)):
                commands.append(Command(0, b"", len(buffer), MaestroError.PROTOCOL))
            self._buffer = b""
        elif not buffer:
            return [Command(0, b"", 1, MaestroError.PROTOCOL)]
        self._buffer += bytes((byte,))
        command = self._complete()
        return [*commands, command] if command else commands

    def _complete(self) -> Command | None:
        """The command in the buffer, once all its bytes are there."""
        buffer = self._buffer
        start = 3 if buffer[0] == guide.POLOLU else 1
        if len(buffer) < start:
            return None
        code = buffer[2] | 0x80 if start == 3 else buffer[0]
        length = -1 if start == 3 and code == guide.MINI_SSC else _LENGTHS.get(code, -1)
        if code == guide.SET_MULTIPLE:
            length = 2 + 2 * buffer[start] if len(buffer) > start else 1
        checked = self._crc and code != guide.MINI_SSC
        size = start + length + checked
        if length >= 0 and len(buffer) < size:
            return None
        message = self.take_pending()
        if length < 0:
            return Command(0, b"", len(message), MaestroError.PROTOCOL)
        if checked and crc7(message[:-1]) != message[-1]:
            return Command(0, b"", size, MaestroError.CRC)
        if start == 3 and message[1] != self._device:
            return None
        return Command(code, message[start : start + length], size)


class Maestro(Board):
    """A Mini Maestro, or with 6 channels a Micro Maestro, on one port.

    channels : 6, 12, 18 or 24 outputs; as an attribute the outputs themselves, quarter microseconds.
    faults : see :data:`drivers.sim.boards.board.FAULTS`.
    device, crc : see `MaestroReader`.
    limits_us : pulse limits of every channel, as set in Pololu's Control Center.
    errors : bits of Get Errors that were not read yet.
    """

    def __init__(
        self,
        channels: int = 24,
        now_s: float = 0.0,
        faults: Iterable[str | Fault] = (),
        device: int = 12,
        crc: bool = False,
        limits_us: tuple[float, float] = LIMITS_US,
        seed: int = 0,
    ) -> None:
        self._settings = device, crc
        self._count, self._limits = channels, (limits_us[0] / guide.TARGET_US, limits_us[1] / guide.TARGET_US)
        self._handlers: dict[int, Callable[[bytes, float], bytes | None]] = {
            guide.SET_TARGET: lambda data, now_s: self._go(data[0], _word(data[1:]), now_s),
            guide.SET_MULTIPLE: self._set_multiple,
            guide.MINI_SSC: self._mini_ssc,
            guide.SET_SPEED: lambda data, now_s: self._limit(self.speeds, data, now_s),
            guide.SET_ACCELERATION: lambda data, now_s: self._limit(self.accelerations, data, now_s),
            guide.GET_POSITION: self._get_position,
            guide.GET_MOVING: lambda data, now_s: bytes((any(channel.moving(now_s) for channel in self.channels),)),
            guide.GET_ERRORS: self._get_errors,
            guide.GO_HOME: lambda data, now_s: self._go_home(now_s),
            guide.SCRIPT_STATUS: lambda data, now_s: b"\x01",
        }
        super().__init__(now_s, faults, seed)

    def reset(self, now_s: float) -> None:
        """The state after power-on: no pulses, no limits of speed and acceleration."""
        self.channels = [RcChannel() for _ in range(self._count)]
        self.speeds, self.accelerations = [0] * self._count, [0] * self._count
        self.errors = MaestroError(0)

    def make_reader(self) -> MaestroReader:
        return MaestroReader(*self._settings)

    def size(self, packet: Command) -> int:
        return packet.size

    def answer(self, packet: Command, now_s: float) -> list[tuple[int, bytes]]:
        """Carry out a command. An error sends every channel home and is kept until it is read."""
        error = packet.error
        if self._count == 6 and packet.code in _MINI_ONLY:
            error = MaestroError.PROTOCOL
        if error:
            self._refuse(error, now_s)
            return []
        handler = self._handlers.get(packet.code)
        data = handler(packet.data, now_s) if handler else None
        return [(packet.data[0] if packet.code == guide.GET_POSITION else 0, data)] if data else []

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """Pulse width in microseconds and target of each channel."""
        return [channel.describe(k, now_s, guide.TARGET_US) for k, channel in enumerate(self.channels)]

    def _refuse(self, error: MaestroError, now_s: float) -> None:
        self.errors |= error
        self._go_home(now_s)

    def _go(self, number: int, target: float, now_s: float) -> None:
        """A target is cut to the channel's limits; one for a channel that is not there is a protocol error."""
        if number >= self._count:
            self._refuse(MaestroError.PROTOCOL, now_s)
            return
        if target:
            target = min(max(target, self._limits[0]), self._limits[1])
        speed = self.speeds[number] * guide.SPEED_UNIT
        acceleration = self.accelerations[number] * guide.ACCELERATION_UNIT
        self.channels[number].go(target, now_s, speed, acceleration)

    def _set_multiple(self, data: bytes, now_s: float) -> None:
        for k in range(data[0]):
            self._go(data[1] + k, _word(data[2 + 2 * k :]), now_s)

    def _mini_ssc(self, data: bytes, now_s: float) -> None:
        """8-bit target, 0 to 254; numbers beyond the channels are those of other boards on the same line."""
        if data[0] < self._count:
            pulse_us = guide.NEUTRAL_US + (data[1] - 127) / 127 * guide.RANGE_US
            self._go(data[0], pulse_us / guide.TARGET_US, now_s)

    def _limit(self, limits: list[int], data: bytes, now_s: float) -> None:
        if data[0] < self._count:
            limits[data[0]] = _word(data[1:])
        else:
            self._refuse(MaestroError.PROTOCOL, now_s)

    def _get_position(self, data: bytes, now_s: float) -> bytes | None:
        """The pulse that is put out, not the shaft: two full bytes, low first."""
        (number,) = data
        if number < self._count:
            return round(self.channels[number].position(now_s)).to_bytes(2, "little")
        self._refuse(MaestroError.PROTOCOL, now_s)
        return None

    def _get_errors(self, data: bytes, now_s: float) -> bytes:
        """Reading clears them."""
        errors, self.errors = int(self.errors), MaestroError(0)
        return errors.to_bytes(2, "little")

    def _go_home(self, now_s: float) -> None:
        """Home is "off" by default: pulses stop."""
        for channel in self.channels:
            channel.go(0.0, now_s)


def _word(data: bytes) -> int:
    """14 bits, low seven first."""
    return data[0] | data[1] << 7


SIZES = (6, 12, 18, 24)


@dataclass(frozen=True, kw_only=True)
class MaestroOptions:
    """Options of ``omote simulate maestro``."""

    channels: int = option("6 (Micro Maestro), 12, 18 or 24.", 24)
    device: int = option("Device number of the Pololu protocol.", 12, at_least=0, at_most=127)
    crc: bool = option("Commands end with a CRC-7.", False)
    baud: int = option("Baud rate of the board.", BOARD_BAUD, at_least=300)


def _alone(options: MaestroOptions, setting: Setting) -> Maestro:
    if options.channels not in SIZES:
        raise DriverError(f"--channels {options.channels}: no Maestro has so many", hint="6, 12, 18 or 24")
    return Maestro(options.channels, setting.now_s, seed=setting.seed, device=options.device, crc=options.crc)


def _far_end(servos: Servos, options: Mapping[str, Any], setting: Setting) -> Maestro:
    """Create the smallest board that has the highest channel."""
    others = dict(options)
    sizes = SIZES if others.pop("board", "mini") == "micro" else SIZES[1:]
    highest = max(channel for channel, _ in servos)
    channels = next((size for size in sizes if highest < size), sizes[-1])
    return Maestro(channels, setting.now_s, seed=setting.seed, **others)


SIMULATOR = Simulator(
    far_end=_far_end,
    alone=_alone,
    options=MaestroOptions,
    decoder=lambda line: HexDecoder(),
    help="""Serve a simulated Pololu Maestro until interrupted; prints `ready PATH`.

    Example: omote simulate maestro --link /tmp/maestro
    """,
)
