"""Bus loop: a thread that drives the servos of one bus at its own rate and reads their positions back.

Only the loop uses its bus. It takes the newest parameters each cycle, keeps its newest measurement for others to read,
and never waits for the face.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from controller.base.clock import Clock, Samples
from controller.base.linked_clocks import FedClock
from controller.base.parameters import Flags, Floats, Parameters
from controller.base.stop_latch import StopLatch
from controller.robot.buses import BusSettings
from controller.robot.channels import servo_specs
from controller.robot.following import FollowingStatistics
from controller.robot.idle_torque import IdleTorqueOff
from controller.robot.linkages.kind import LinkageSettings
from controller.robot.safety import GoalFilter
from controller.robot.settings import ChannelSettings, RuleSettings
from drivers import open_bus
from drivers.base.bus import Bus, BusState
from drivers.base.errors import DriverError, NoReply, PortLost
from drivers.base.priority import request_realtime

if TYPE_CHECKING:
    from controller.robot.anchors import AnchorSolver  # imported lazily: it loads the head

log = logging.getLogger(__name__)

Newest = Callable[[], tuple[Floats, int]]

_RETRY_INTERVAL_NS = 1_000_000_000
_MAX_START_READS = 10
_MAX_REST_NS = 2_000_000_000
_MAX_REST_ERROR_RAD = 0.02


class BusLoop:
    """Drives the channels of one bus until it is stopped.

    settings : the bus. channels : its channels, one for each servo. parameters : all that the channels' mixes may name.
    newest : returns the newest parameter vector (p,) float64 and the time (monotonic ns) at which its command arrived,
        0 for none.
    rules : the robot's safety rules. anchors : solver of the robot's anchored channels, on this bus or another.
    linkages : the linkages of this bus's channels.
    limp : disable torque and only read the positions of the servos.
    feed_s : time between calls of :meth:`feed`, with which cycles are synchronised; 0 for a bus with its own clock.
    stop_latch : while it is set, torque is off, whatever else is asked, and only positions are read. Afterwards the
        servos start again at their present positions.
    """

    def __init__(
        self,
        settings: BusSettings,
        channels: Sequence[ChannelSettings],
        parameters: Parameters,
        newest: Newest,
        rules: RuleSettings = RuleSettings(),
        anchors: AnchorSolver | None = None,
        linkages: Sequence[LinkageSettings] = (),
        *,
        limp: bool = False,
        feed_s: float = 0.0,
        stop_latch: StopLatch | None = None,
    ) -> None:
        self.settings = settings
        self._goals = GoalFilter(channels, parameters, rules, 1.0 / settings.rate_hz, anchors, linkages)
        self.table = self._goals.table
        specs = servo_specs(channels, self.table.neutral_rad)
        self.bus: Bus = open_bus(settings.kind, specs, **settings.options())
        self.clock = FedClock(settings.rate_hz, feed_s)
        self.latency_ms = Samples()
        self.following = FollowingStatistics(self.table, parameters)
        self.held = 0
        self.limp = limp
        self.realtime = False
        self.error: Exception | None = None
        self._newest, self._stop_latch = newest, stop_latch or StopLatch()
        self._last_stamp = 0
        self._retry_ns: int | None = None  # when to try again what failed; None while nothing has
        self._off = False  # torque is off, or being disabled, because of the latch or a failure
        self._driven = self.bus.driven
        self._idle, self._is_idle = (
            IdleTorqueOff(settings.let_go_s, settings.let_go_below_a),
            False,
        )  # torque off while idle
        self._state: BusState | None = None
        self._stopping, self._begun = threading.Event(), threading.Event()
        self._jogs: dict[str, float] = {}
        self._last_reason = ""
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the bus, start the servos safely and begin to drive them.

        Raises DriverError when the port or a servo does not come up; the bus is closed again.
        """
        try:
            self.bus.open()
            stopped = self._stop_latch.stopped is not None
            may_start = self.bus.measures or not self.limp  # starting a board moves servos whose positions are unknown
            if not stopped and may_start:
                self.bus.start()
                self._resume()
            self._off = stopped and not self.limp
            if self.limp:
                self.bus.stop()
                if not self.bus.measures:
                    log.warning("bus %s does not measure its servos: the face cannot follow", self.settings.name)
        except BaseException:
            self.bus.close()
            raise
        self._thread = threading.Thread(target=self._run, name=f"bus {self.settings.name}", daemon=True)
        self._thread.start()

    def feed(self, step_s: float, *, urgent: bool) -> None:
        """Report new parameters, ``step_s`` after the last ones; the next cycle begins with urgent ones."""
        self.clock.feed(step_s, urgent=urgent)

    def jog(self, channel: str, angle_rad: float | None) -> None:
        """Turn a channel's servo to an angle within its limits, whatever the face wants; None ends that.

        The limits of speed and acceleration and the safety rules apply. May be called from any thread. An unknown
        channel is ignored.
        """
        jogs = {name: angle for name, angle in self._jogs.items() if name != channel}
        if angle_rad is not None and channel in self.table.names:
            i = self.table.names.index(channel)
            jogs[channel] = float(np.clip(angle_rad, self.table.low_rad[i], self.table.high_rad[i]))
        self._jogs = jogs  # replaced as a whole, because the thread of the bus reads it

    def end_jogs(self) -> None:
        """Let all servos follow the face again."""
        self._jogs = {}

    def begin(self) -> None:
        """Follow the parameters from now on; until then the servos are held at the positions they started at."""
        self._begun.set()

    def stop(self) -> None:
        """Stop driving, switch torque off on every reachable servo and close the port."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
        try:
            self.bus.stop()
        finally:
            self.bus.close()

    def measured(self) -> BusState | None:
        """The newest measurement, or None before the first."""
        return self._state

    @property
    def goals_rad(self) -> Floats:
        """(n,) the goals that were sent last, rad."""
        return self._goals.sent.copy()

    def _resume(self) -> None:
        """Continue from where the servos are, so that the first goals are a ramp from there."""
        position = self._read_until_fresh().position_rad
        self._goals.restart(np.where(np.isfinite(position), position, self._goals.sent))
        self._driven = self.bus.driven

    def _read_until_fresh(self) -> BusState:
        """Read until every servo whose position must be known has just been measured; raises NoReply if some are not.

        At the first start these are all servos, later only the driven ones. Old positions are unsafe to use.
        """
        for _ in range(_MAX_START_READS):
            state = self._state = self.bus.read()
            missing = ~state.fresh & self.bus.measures & (self._needed() | (self._thread is None))
            if not missing.any():
                return state
        names = [name for name, absent in zip(self.table.names, missing, strict=True) if absent]
        raise NoReply(
            f"bus {self.settings.name}: the position of {', '.join(names)} is not known: no answer",
            hint="check its cable and its power supply, then start again",
        )

    def _needed(self) -> Flags:
        """Servos whose positions must be known: the driven ones, and none while the bus is limp."""
        return self.bus.driven & (not self.limp)

    def _run(self) -> None:
        self.realtime = request_realtime()
        try:
            for now in self.clock.run(lambda: not self._stopping.is_set()):
                self._tick(now)
            if not self.limp:
                self._come_to_rest()
        except Exception as error:  # noqa: BLE001  the control process (body) raises it and stops the servos
            self.error = error

    def _tick(self, now: int) -> None:
        """One cycle. The latch comes before anything else."""
        try:
            if self._stop_latch.stopped is not None and not self.limp:
                self._stay_off(now)
            elif self._retry_ns is None and not self._off:
                self._cycle()
            elif self._retry_ns is None or now >= self._retry_ns:
                self._come_back(now)
        except PortLost as error:
            log.warning("%s; trying again every %g s", error, _RETRY_INTERVAL_NS / 1e9)
            self._retry_ns = 0

    def _stay_off(self, now: int) -> None:
        """Disable torque, again every second where some servos are not confirmed off, and only read positions."""
        if self.bus.running:
            self._off, self._retry_ns = True, 0
            log.warning("bus %s: the servos are off until START", self.settings.name)
        if self._retry_ns is not None and now >= self._retry_ns:
            self._switch_off(now)
        if self.bus.is_open:
            self._state = self.bus.read()

    def _switch_off(self, now: int) -> None:
        try:
            self.bus.stop()
            if not self.bus.is_open:
                self.bus.reconnect()  # this only opens the port, because the bus is stopped
        except DriverError as error:
            self._try_later(now, "not off for certain", error)
        else:
            self._retry_ns = None

    def _cycle(self) -> None:
        if self.limp:
            self._state = self.bus.read()
        else:
            self._drive()

    def _drive(self) -> None:
        self._follow_absent()
        if not self._begun.is_set():
            self.bus.write(self._goals.sent)
            self._state = self.bus.read()
            return
        values, stamp = self._newest()
        angles, held = self.table.angles(values)
        for name, angle in self._jogs.items():
            angles[self.table.names.index(name)] = angle
        if self._is_idle and not self._wake(angles):
            return
        self.held += held
        wanted = np.where(self._driven, angles, self._goals.sent)
        self.bus.write(self._goals.step(wanted, self._state, self.clock.step_s))
        if stamp > self._last_stamp:
            self._last_stamp = stamp
            self.latency_ms.add((time.monotonic_ns() - stamp) / 1e6)
        self._state = self.bus.read()
        self.following.add(angles, self._state)
        if self._idle.update(self._goals.sent, self._state, self.clock.step_s):
            self._disable_idle_torque(angles, self._state)

    def _disable_idle_torque(self, wanted: Floats, state: BusState) -> None:
        """Disable the torque of an idle bus; where that fails, the servos are started again as after a STOP."""
        try:
            self.bus.stop()
        except PortLost:
            self._off = True  # a bus that does not run is only opened again by reconnecting
            raise
        except DriverError as error:
            self._off = True
            self._try_later(time.monotonic_ns(), "idle, but its torque is not off for certain", error)
            return
        self._is_idle = True
        self._idle.note_torque_off(wanted, state)
        log.info("bus %s is idle: torque off", self.settings.name)

    def _wake(self, wanted: Floats) -> bool:
        """Read an idle bus, and enable its torque where the servos are once a target or a servo has moved.

        Return whether the servos are driven again.
        """
        state = self._state = self.bus.read()
        if not self._idle.check_wake(wanted, state):
            return False
        self._is_idle = False
        try:
            self.bus.start(partly=True)
            self._resume()
        except PortLost:
            self._off = True  # a bus that does not run is only opened again by reconnecting
            raise
        except DriverError as error:
            self._off = True  # _come_back tries again, as after a STOP
            self._try_later(time.monotonic_ns(), "not back", error)
            return False
        return True

    def _follow_absent(self) -> None:
        """Set the goals of servos that are not driven, or were not before the last read, to their positions."""
        driven = self.bus.driven
        if driven is not self._driven or not driven.all():
            absent = ~(driven & self._driven)
            if self._state is not None:
                self._goals.restart_some(absent, self._state.position_rad)
            self._driven = driven

    def _come_to_rest(self) -> None:
        """Move the servos to the neutral face before torque is switched off, so that no part of the head drops."""
        rest = self.table.neutral_rad
        end_ns = time.monotonic_ns() + _MAX_REST_NS
        with suppress(DriverError):  # a bus that fails here is stopped where it is
            for now in Clock(self.settings.rate_hz).run(self._may_move):
                self._follow_absent()
                self.bus.write(self._goals.step(rest, self._state))
                state = self._state = self.bus.read()
                known = state.fresh | (not self.bus.measures)
                away = np.where(known, np.abs(state.position_rad - rest), np.where(self.bus.driven, np.inf, 0.0))
                if now > end_ns or away.max() < _MAX_REST_ERROR_RAD:
                    return

    def _may_move(self) -> bool:
        return self._retry_ns is None and not self._off and self._stop_latch.stopped is None

    def _come_back(self, now: int) -> None:
        """Try once to drive again after START or the loss of the port; motion continues from the measured positions."""
        try:
            if not self._off or not self.bus.is_open:
                self.bus.reconnect()
            if self._off:
                self.bus.start(partly=True)
            self._resume()
        except DriverError as error:
            self._try_later(now, "not back", error)
        else:
            log.warning("bus %s is back", self.settings.name)
            self._off, self._retry_ns, self._last_reason = False, None, ""

    def _try_later(self, now: int, condition: str, error: DriverError) -> None:
        """Schedule the next try for a second later; log a new reason once."""
        if str(error) != self._last_reason:
            self._last_reason = str(error)
            log.warning("bus %s is %s: %s", self.settings.name, condition, error)
        self._retry_ns = now + _RETRY_INTERVAL_NS

    def condition(self) -> dict[str, object]:
        """The name of the bus, whether it runs, and its fault as text (empty: none). May be called from any thread."""
        absent = self._last_reason if self._retry_ns is not None else ""
        fault = str(self.error) if self.error is not None else absent
        return {"name": self.settings.name, "running": bool(self.bus.running), "fault": fault}

    def report(self) -> dict[str, object]:
        """Measurements: rate and jitter, command-to-wire latency, errors by kind, limits hit."""
        return {
            "name": self.settings.name,
            "servos": len(self.table.names),
            "realtime": self.realtime,
            **self.clock.report(),
            "command_to_wire_ms": self.latency_ms.summary(),
            "channels_held_at_limit": self.held,
            "rules": self._goals.guard.report(),
            "let_go": {"times": self._idle.torque_off_count, "sagged": self._idle.drift_wake_count},
            "linkages_out_of_reach": self._goals.out_of_reach(),
            "face_difference": self.following.report(),
            "bus": self.bus.report().as_dict(),
            "stopped_by": stopped.who if (stopped := self._stop_latch.stopped) else None,
            "fault": str(self.error) if self.error else None,
        }
