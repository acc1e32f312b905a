"""A wire of Dynamixel servos, Protocol 2.0: one sync write and one sync read a cycle.

What keeps it alive: a servo that misses its time is left out of the group until it has answered a ping (once a
second at most while it is silent), so the others go on; every goal is limited in angle and in speed; a tripped
watchdog is cleared with the goal where the servo is; and a motor that let go by itself is told, never switched
on again behind the user's back.
"""

from __future__ import annotations

import copy
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from drivers.bus import Bus, BusReport, BusState, Floats, ServoInfo, ServoSpec, frozen
from drivers.dynamixel import startup
from drivers.dynamixel.layout import Scale
from drivers.dynamixel.port import Port
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Packets
from drivers.dynamixel.startup import Policy
from drivers.dynamixel.tables import load_table, model_name, model_number
from drivers.dynamixel.telemetry import Telemetry
from drivers.errors import BusError, DriverError, PortLost
from drivers.guard import SpeedGuard

if TYPE_CHECKING:
    from collections.abc import Iterator

log = logging.getLogger(__name__)


class DynamixelBus(Bus):
    """Dynamixel servos on one serial port. See :class:`~drivers.bus.Bus` for the contract.

    Parameters
    ----------
    servos : the servos in the order of all arrays.
    port : device path; ``/dev/serial/by-id/...`` survives a replug.
    baud : rate on the wire.
    feedback : ``"full"`` reads velocity and current with every position, ``"position"`` only the position.
    fast : use fast sync read where every servo's firmware has it.
    margin_s : longest wait for a reply beyond its time on the wire; None takes it from the latency timer.
    slow_group : servos asked for one slow value (torque, error, watchdog, supply) each cycle; 0 asks only about
        servos that raise an alert.
    faults : only a simulated bus takes any.
    clock : monotonic seconds.
    policy : fields of :class:`~drivers.dynamixel.startup.Policy`, such as ``watchdog_ms``.

    Raises
    ------
    DriverError : unknown model, or an option that does not fit.
    """

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str,
        baud: int = 1_000_000,
        feedback: str = "full",
        fast: bool = False,
        margin_s: float | None = None,
        slow_group: int = 4,
        faults: Sequence[str] = (),
        clock: Callable[[], float] = time.monotonic,
        **policy: object,
    ) -> None:
        super().__init__(servos)
        if faults and type(self) is DynamixelBus:
            raise DriverError("faults can only be given to a simulated bus", hint='set kind = "simulated"')
        self.policy = Policy(**policy)  # type: ignore[arg-type]
        self._clock = clock
        self._port = Port(port, baud, margin_s)
        self._registers = Registers(Packets(), self._port, self.servos)
        self._tables([load_table(model_number(servo.model)) for servo in self.servos])
        self._report = BusReport()
        self._telemetry = Telemetry(self._registers, self.ids, self._report, feedback, fast, slow_group)
        self._guard = SpeedGuard(np.array([servo.max_speed_rad_s for servo in self.servos]))
        self._low = np.array([servo.min_rad for servo in self.servos])
        self._high = np.array([servo.max_rad for servo in self.servos])
        self._target: Floats = np.zeros(len(self.servos))
        self._running = False
        self._lost = False
        self._heard_s = 0.0

    # ------------------------------------------------------------------ the port

    @property
    def is_open(self) -> bool:
        """True while the port is held."""
        return bool(self._port.is_open)

    @property
    def running(self) -> bool:
        """True between ``start`` and ``stop``."""
        return self._running

    @property
    def path(self) -> str:
        """Device path in use."""
        return self._port.link.path

    def open(self) -> None:
        """Take the port; see :meth:`drivers.bus.Bus.open`."""
        self._port.openPort()
        self._lost = False

    def reconnect(self) -> None:
        """Take the port again and, if the bus was running, start from where the servos are now.

        When that fails the bus counts as lost still, so that no goal goes out; call again later.
        """
        self._port.closePort()
        self.open()
        if not self._running:
            return
        try:
            self._start()
        except BaseException:
            self._lost = True
            self._port.closePort()
            raise

    def _release(self) -> None:
        self._port.closePort()

    @contextmanager
    def _losing(self) -> Iterator[None]:
        """Close the port and count once when it goes away."""
        if self._lost or not self.is_open:
            raise PortLost(
                f"port {self.path} is {'lost' if self._lost else 'not open'}",
                hint="plug it in again and call reconnect()" if self._lost else "call open()",
                port=self.path,
                servo_ids=self.ids,
            )
        try:
            yield
        except PortLost:
            self._lost = True
            self._port.closePort()
            self._report.count("port_lost")
            log.error("port %s went away", self.path)
            raise

    # ------------------------------------------------------------------ looking, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Who is there; ``ids`` None asks everybody at once, which takes about a second."""
        with self._losing():
            if ids is None:
                found = self._registers.packets.ping_all(self._port)
            else:
                replies = {i: self._registers.packets.hello(self._port, i) for i in ids}
                found = {i: reply.params for i, reply in replies.items() if reply is not None}
            return [self._info(servo, params) for servo, params in sorted(found.items())]

    def _info(self, servo: int, params: bytes) -> ServoInfo:
        number, firmware = params[0] | params[1] << 8, params[2]
        info = ServoInfo(servo, number, model_name(number), firmware)
        probe = Registers(self._registers.packets, self._port, self.servos)
        try:
            probe.tables[servo] = load_table(number, firmware)
            volts, temperature = probe.get(servo, "voltage"), probe.get(servo, "temperature")
            hardware, torque = probe.get(servo, "hardware"), probe.get(servo, "torque")
        except PortLost:
            raise
        except DriverError:  # an unknown model or a servo that keeps quiet is still found
            return info
        return ServoInfo(*info_head(info), volts / 10.0, float(temperature), hardware, bool(torque))

    def start(self) -> None:
        """Check every servo and switch it on where it stands; see :meth:`drivers.bus.Bus.start`."""
        if not self._running:
            self._start()

    def _start(self) -> None:
        with self._losing():
            self._port.suspects.clear()
            startup.identify(self._registers, self.servos)
            self._tables([self._registers.tables[servo] for servo in self.ids])
            self._telemetry.rebuild()
            started = startup.bring_up(self._registers, self.servos, self.policy)
            self._report.eeprom_writes += started.eeprom
            for index, servo in enumerate(self.ids):
                if servo in started.limits:
                    self.scale.narrow(index, *started.limits[servo])
            self._begin_at(np.array([started.ticks[servo] for servo in self.ids]))
            self._telemetry.started(self.ids)
            self._running = True

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Bring servos back that let go or were rebooted, where they stand; ``ids`` None means all of them.

        Raises
        ------
        BusError : one does not come back; see :class:`~drivers.dynamixel.startup.Policy` for what is allowed.
        """
        chosen = [servo for servo in self.servos if ids is None or servo.id in ids]
        with self._losing():
            startup.identify(self._registers, chosen)
            started = startup.bring_up(self._registers, chosen, self.policy)
            self._report.eeprom_writes += started.eeprom
            for servo, ticks in started.ticks.items():
                self._hold(self.ids.index(servo), ticks)
            self._telemetry.started(list(started.ticks))

    def stop(self) -> None:
        """Torque off for every reachable servo; see :meth:`drivers.bus.Bus.stop`."""
        if not self._running:
            return
        self._running = False
        if self._lost:  # the adapter may be back
            self._reconnect_to_stop()
        with self._losing():
            startup.switch_off(self._registers, self.ids)

    def _reconnect_to_stop(self) -> None:
        """Take the port again; without it nothing can be said of the servos, and that is what a user must hear."""
        try:
            self.reconnect()
        except DriverError as error:
            raise PortLost(
                f"servos not confirmed off, for their port is gone: {error}",
                hint="switch the servos' power off",
                port=self.path,
                servo_ids=self.ids,
            ) from error

    def _tables(self, tables: list) -> None:
        self._registers.tables = dict(zip(self.ids, tables, strict=True))
        self.scale = Scale(self.servos, tables)

    def _begin_at(self, ticks: np.ndarray) -> None:
        position = self.scale.radians(ticks)
        self._target = position
        self._heard_s = self._clock()
        self._guard.reset(position, self._heard_s)

    def _hold(self, index: int, ticks: int) -> None:
        """One servo begins again from a position."""
        full = np.zeros(len(self.ids))
        full[index] = ticks
        position = float(self.scale.radians(full)[index])
        self._target[index] = position
        self._guard.reset_one(index, position)

    # ------------------------------------------------------------------ every cycle

    def write(self, angle_rad: ArrayLike) -> Floats:
        """One sync write of all goals; see :meth:`drivers.bus.Bus.write`.

        Raises
        ------
        ValueError : not n angles.
        BusError : the bus was not started.
        """
        wanted = np.asarray(angle_rad, dtype=np.float64)
        if wanted.shape != self._target.shape:
            raise ValueError(f"angle_rad: shape {wanted.shape}, expected {self._target.shape}")
        if not self._running:
            raise BusError(f"the bus on {self.path} is not started", hint="call start()", port=self.path)
        with self._losing():
            now = self._clock()
            self._after_a_pause(now)
            ticks = self._limited(wanted, now)
            self._telemetry.send_goals(ticks)
            self._report.writes += 1
            return frozen(self.scale.radians(ticks))

    def _limited(self, wanted: Floats, now: float) -> np.ndarray:
        """Goals in steps: angle limits, then top speed, then the servos' own limits."""
        known = np.isfinite(wanted)
        self._report.refused_targets += int(np.count_nonzero(~known))
        target = np.where(known, wanted, self._target)
        clipped = np.minimum(np.maximum(target, self._low), self._high)
        self._report.limits_hit += int(np.count_nonzero(clipped != target))
        self._target = clipped
        allowed = self._guard.step(clipped, now)
        self._report.speed_limited += int(np.count_nonzero(np.abs(allowed - clipped) > 1e-9))
        return np.minimum(np.maximum(self.scale.ticks(allowed), self.scale.low), self.scale.high)

    def _after_a_pause(self, now: float) -> None:
        """Look at all watchdogs when the caller was away for so long that they may have tripped."""
        pause, self._heard_s = now - self._heard_s, now
        limit = self.policy.watchdog_ms / 1000.0
        if self._running and limit and pause > limit:
            self._telemetry.ask_watchdogs()
            self._clear_watchdogs()

    def read(self) -> BusState:
        """One sync read of all servos and one slow value of some; see :meth:`drivers.bus.Bus.read`."""
        with self._losing():
            self._after_a_pause(self._clock())
            self._telemetry.cycle(self._clock, self._running)
            if self._running:
                self._clear_watchdogs()
            self._report.cycles += 1
            return self._telemetry.state(self.scale, self._clock())

    def _clear_watchdogs(self) -> None:
        """Clear tripped watchdogs with the goal where the servo stands, so that nothing jumps."""
        for servo in self._telemetry.take_tripped():
            try:
                self._registers.put(servo, "watchdog", 0, tries=1)
                goal = startup.goals_at_present(self._registers, [servo], {})[servo]
                self._registers.put(servo, "goal", goal, tries=1)
                self._registers.put(servo, "watchdog", self.policy.watchdog_steps, tries=1)
            except PortLost:
                raise
            except BusError as error:
                log.warning("watchdog not cleared yet: %s", error)
                self._telemetry.retry_tripped(servo)  # its register may read 0 now: it would never be seen again
                continue
            self._hold(self.ids.index(servo), goal)

    def report(self) -> BusReport:
        """A copy of the counters."""
        self._report.stray = self._port.stray
        self._report.silent = self._telemetry.silent_ids()
        return copy.deepcopy(self._report)


def info_head(info: ServoInfo) -> tuple[int, int, str, int]:
    """What a servo says in its ping."""
    return info.id, info.model_number, info.model, info.firmware
