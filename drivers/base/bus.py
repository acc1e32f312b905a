"""The interface ``Bus`` that every servo driver implements: open, discover, start, write, read, stop, report.

One bus is one wire with many servos. The caller owns the clock and calls ``write`` and ``read`` once a cycle from one
thread. Nothing is queued: ``write`` sends the newest target and returns what was really sent, ``read`` returns what is
known, with an age for everything that is old.

All arrays are in the order of the ``servos`` of the bus; ``n`` is ``len(bus.servos)``. Angles are the servo's own:
radians from the middle of its range (tick 2048 of 4096), positive where ticks grow. With ``zero_rad`` and ``reverse``
set, ``shaft = zero_rad + (-1 if reverse else 1) * angle``.
"""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from types import TracebackType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.base.errors import DriverError

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class ServoSpec:
    """Configuration of one servo.

    id : number on the bus, 0 to 252.
    name : its name in messages, for example ``"jaw"``.
    model : vendor model name in any case, for example ``"xl330-m288"``.
    min_rad, max_rad : limits of the angle; nothing outside them is ever sent.
    max_speed_rad_s, max_accel_rad_s2 : limits of the motion, above zero.
    reverse : the angle grows where ticks fall.
    zero_rad : shaft angle from the middle of the range at which the angle is zero.
    rest_rad : angle at which a servo starts whose position cannot be read; clipped to the limits.
    pulse_us : calibrated (angle rad, pulse us) of a hobby servo, two or more; empty: those of the model.
    wire_name : its name on a wire that sends names; empty: ``name``.

    Raises ValueError: a value is not finite, empty or out of order; the message names it.
    """

    id: int
    name: str
    model: str
    min_rad: float
    max_rad: float
    max_speed_rad_s: float
    max_accel_rad_s2: float
    reverse: bool = False
    zero_rad: float = 0.0
    rest_rad: float = 0.0
    pulse_us: tuple[tuple[float, float], ...] = ()
    wire_name: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.id <= 252:
            raise ValueError(f"servo {self.name!r}: id must be 0 to 252, got {self.id}")
        for key in ("min_rad", "max_rad", "max_speed_rad_s", "max_accel_rad_s2", "zero_rad", "rest_rad"):
            if not math.isfinite(getattr(self, key)):
                raise ValueError(f"servo {self.name!r} (id {self.id}): {key} must be a finite number")
        if self.min_rad >= self.max_rad:
            raise ValueError(f"servo {self.name!r} (id {self.id}): min_rad must be below max_rad")
        if min(self.max_speed_rad_s, self.max_accel_rad_s2) <= 0:
            raise ValueError(f"servo {self.name!r} (id {self.id}): max speed and acceleration must be above zero")


@dataclass(frozen=True, slots=True)
class ServoInfo:
    """What discovery found out about a servo; None where the servo cannot report it."""

    id: int
    model_number: int
    model: str
    firmware: int
    voltage_v: float | None = None
    temperature_c: float | None = None
    hardware_error: int | None = None
    torque: bool | None = None


@dataclass(frozen=True, slots=True, eq=False)
class BusState:
    """State of every servo after one read. All arrays are read-only, shape ``(n,)``.

    time_s : monotonic clock when the read ended.
    position_rad : last good position; NaN before the first one.
    velocity_rad_s, current_a : from the same reply; NaN where the model does not measure it.
    fresh : True where this cycle measured the position. Never use a position that is not fresh as a pose. Always False
        on a bus that does not measure; the position is then what the board reports it puts out, or what was sent.
    age_s : seconds since the position arrived; inf before the first one, and where nothing can be read.
    error : error byte of the last reply (bit 7: alert, a hardware error is latched; bits 0-6: a number).
    silent : True where the servo stopped answering and is only probed now and then.
    voltage_v, temperature_c : polled in turn; NaN before the first poll.
    hardware_error : last polled register, 0 is none; the bits depend on the model.
    torque : True where the servo reported that its motor is on (polled in turn).
    """

    time_s: float
    position_rad: Floats
    velocity_rad_s: Floats
    current_a: Floats
    fresh: Flags
    age_s: Floats
    error: Bytes
    silent: Flags
    voltage_v: Floats
    temperature_c: Floats
    hardware_error: Bytes
    torque: Flags


@dataclass(slots=True)
class BusReport:
    """Counters since the bus was opened.

    cycles, writes : reads and writes done.
    errors : count by kind: ``no_reply``, ``corrupt``, ``refused``, ``alert``, ``torque_lost``, ``watchdog``,
        ``reset`` (a servo lost its settings, as after a dip of its supply), ``port_lost``, ``unkept`` (no dead man's
        switch is running), ``held_back`` (goals not sent because a line head was busy) and ``board_...`` (errors that a
        board reports). Kinds that never occurred are missing.
    errors_by_servo : the same by servo id.
    limits_hit : targets clipped to an angle limit.
    speed_limited : targets shortened because they needed more than the servo's top speed.
    refused_targets : targets that were not a number.
    stray : replies discarded because they answer no request (late, duplicated, echo or noise).
    eeprom_writes : one line for every permanent register written.
    silent : ids that are not answering now.
    not_driven : ids of servos that are sent no goals now, see ``Bus.driven``.
    """

    cycles: int = 0
    writes: int = 0
    errors: dict[str, int] = field(default_factory=dict)
    errors_by_servo: dict[int, dict[str, int]] = field(default_factory=dict)
    limits_hit: int = 0
    speed_limited: int = 0
    refused_targets: int = 0
    stray: int = 0
    eeprom_writes: list[str] = field(default_factory=list)
    silent: tuple[int, ...] = ()
    not_driven: tuple[int, ...] = ()

    def count(self, kind: str, servo_id: int | None = None) -> None:
        """Add one error of a kind, for a servo where one is concerned."""
        self.errors[kind] = self.errors.get(kind, 0) + 1
        if servo_id is not None:
            by_kind = self.errors_by_servo.setdefault(servo_id, {})
            by_kind[kind] = by_kind.get(kind, 0) + 1

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, strings, lists and dictionaries, ready for JSON."""
        return asdict(self)


class Bus(ABC):
    """One wire with servos. Use it as a context manager; one thread only.

    ``with bus:`` opens the port and, on every way out, stops the servos and closes it. When the program is killed
    (SIGKILL), servos with a bus watchdog stop by themselves, ``drivers/core/dead_man_switch.py`` switches off those
    without one, and pulses of hobby servos go on.

    servos : the servos in the order of all arrays. Raises ValueError: no servo, or two with one id.
    measures : positions are measured at the shafts; False for hobby servos, whose states are never fresh.
    """

    measures: ClassVar[bool] = True

    def __init__(self, servos: Iterable[ServoSpec]) -> None:
        self.servos: tuple[ServoSpec, ...] = tuple(servos)
        self.ids: tuple[int, ...] = tuple(servo.id for servo in self.servos)
        if not self.servos:
            raise ValueError("a bus needs at least one servo")
        twice = sorted({i for i in self.ids if self.ids.count(i) > 1})
        if twice:
            raise ValueError(f"two servos have the id {', '.join(map(str, twice))}")

    @property
    @abstractmethod
    def is_open(self) -> bool:
        """True while the port is open."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """True between a ``start`` that succeeded and ``stop``: motors may be on."""

    @property
    def may_be_on(self) -> bool:
        """True where motors may be on and can be tried: while it runs, and where switching them off was not confirmed.

        :meth:`close` stops such a bus first.
        """
        return self.running

    @property
    def driven(self) -> Flags:
        """(n,) servos that are sent goals; all others keep still until it is known where they are.

        A servo is not driven while its position is not known, or while it could not be started with the others. Then
        its goals begin where it is, no faster than its top speed. Servos that measure nothing are always driven.
        """
        return read_only(np.ones(len(self.servos), bool))

    @abstractmethod
    def open(self) -> None:
        """Open the port; raises PortMissing, PortBusy or PortPermission. Nothing is sent."""

    @abstractmethod
    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Look for servos by id; None asks all at once. Nothing moves."""

    @abstractmethod
    def start(self, *, partly: bool = False) -> None:
        """Check every servo and switch the motors on at their present positions, without a movement.

        Raises NoReply, WrongModel, ServoFault, ServoRefused or CorruptReply, before anything moved; see ``servo_ids``.
        With ``partly``, for servos that were started before, those that cannot be are left out (see :attr:`driven`) and
        join when they can; it raises only where that is all of them.
        """

    @abstractmethod
    def write(self, angle_rad: ArrayLike) -> Floats:
        """Send targets (n,) rad, NaN to keep a servo's last one; returns what was sent after limits, (n,) read-only.

        A servo that is not :attr:`driven` is sent nothing; its last goal is returned. Raises PortLost where the port
        went away; see :meth:`reconnect`.
        """

    @abstractmethod
    def read(self) -> BusState:
        """Ask every servo for its state; silent servos are marked, not raised. Raises PortLost as :meth:`write`."""

    @abstractmethod
    def stop(self) -> None:
        """Switch every motor off, each by itself; does nothing when not running.

        Raises NoReply after everything was tried; ``servo_ids`` are those not confirmed off. A second call tries again.
        """

    @abstractmethod
    def reconnect(self) -> None:
        """Open the port again after PortLost, and start the servos again if they were running.

        Servos that cannot be started are left out, as by :meth:`start` with ``partly``. Raises PortMissing or BusError
        while it is unplugged or no servo can be started; call again later.
        """

    @abstractmethod
    def report(self) -> BusReport:
        """Counters since the bus was opened, as a copy."""

    def far_end(self) -> dict[str, Any]:
        """Settings that a simulated far end needs beyond ids and models; plain values for JSON."""
        return {}

    @abstractmethod
    def _release(self) -> None:
        """Close the port; never raises."""

    def close(self) -> None:
        """Stop the servos, then close the port and raise what :meth:`stop` raised; may be called repeatedly."""
        try:
            if self.may_be_on:
                self.stop()
        finally:
            self._release()

    def __enter__(self) -> Self:
        if not self.is_open:
            self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except DriverError as closing:
            if error is None:
                raise
            log.error("%s", closing)  # it must not hide the first error
            error.add_note(f"also: {closing}")


def frozen(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """A read-only copy of an array."""
    return read_only(np.array(values, dtype=dtype))


def make_state(
    time_s: float, measured: Floats, fresh: Flags, silent: Flags, slow_values: Sequence[NDArray[Any]]
) -> BusState:
    """A state of read-only arrays.

    `measured` is (4, n): position, velocity, current and age. `slow_values` are error, supply, temperature, hardware
    error and torque, (n,) each; they, `fresh` and `silent` are read-only already.
    """
    position, velocity, current, age = (read_only(row) for row in measured)
    error, volts, celsius, hardware, torque = slow_values
    return BusState(
        time_s=time_s,
        position_rad=position,
        velocity_rad_s=velocity,
        current_a=current,
        fresh=fresh,
        age_s=age,
        error=error,
        silent=silent,
        voltage_v=volts,
        temperature_c=celsius,
        hardware_error=hardware,
        torque=torque,
    )


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """The array itself, read-only from now on."""
    array.flags.writeable = False
    return array
