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
from controller.robot.letting_go import LettingGo
from controller.robot.linkages.kind import LinkageSettings
from controller.robot.safety import GoalFilter
from controller.robot.settings import ChannelSettings, RuleSettings
from drivers import open_bus
from drivers.base.bus import Bus, BusState
from drivers.base.errors import DriverError, NoReply, PortLost
from drivers.base.priority import request_realtime

if TYPE_CHECKING:
    from controller.robot.anchors import AnchorSolver  # start-up: loads the head

log = logging.getLogger(__name__)

Newest = Callable[[], tuple[Floats, int]]

_RETRY_NS = 1_000_000_000
_READS = 10
_REST_LIMIT_NS = 2_000_000_000
_AT_REST_RAD = 0.02


class BusLoop:
    """Drives the channels of one bus until it is stopped.

    settings : the bus. channels : its channels, one for each servo. parameters : those that the mixes name.
    newest : returns the newest parameter vector (p,) float64 and the time (monotonic ns) at which its command arrived,
        0 for none.
    rules : the robot's safety rules. anchors : solver of the robot's anchored channels, on this bus or another.
    linkages : those of this bus's channels.
    limp : switch the motors off and only read the positions of the servos.
    feed_s : time between calls of :meth:`feed`, after which cycles begin; 0 for a bus that cycles by itself.
    stop_latch : while it is set, the motors are off, whatever else is asked, and the positions are read. Afterwards the
        servos start again where they are.
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
        self._off = False  # the servos are off, or are being switched off, because of the latch
        self._driven = self.bus.driven
        self._letting_go, self._let_go = LettingGo(settings.let_go_s, settings.let_go_below_a), False
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
            follows = self.bus.measures or not self.limp  # starting a board moves servos that nobody knows the place of
            if not stopped and follows:
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
        """Turn a channel's servo to an angle within its limits, whatever the face wants; None gives it back.

        The limits of speed and acceleration hold, and rules too. May be called from any thread. Nothing happens where
        there is no such channel.
        """
        jogs = {name: angle for name, angle in self._jogs.items() if name != channel}
        if angle_rad is not None and channel in self.table.names:
            i = self.table.names.index(channel)
            jogs[channel] = float(np.clip(angle_rad, self.table.low_rad[i], self.table.high_rad[i]))
        self._jogs = jogs  # at once: the thread of the bus reads it

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
        here = self._all_fresh().position_rad
        self._goals.restart(np.where(np.isfinite(here), here, self._goals.sent))
        self._driven = self.bus.driven

    def _all_fresh(self) -> BusState:
        """Read until every servo that is driven has answered; raises NoReply when some do not.

        Old positions are unsafe to use. After the first start, servos that do not answer are not driven.
        """
        for _ in range(_READS):
            state = self._state = self.bus.read()
            missing = ~state.fresh & self.bus.measures & (self._needed() | (self._thread is None))
            if not missing.any():
                return state
        names = [name for name, absent in zip(self.table.names, missing, strict=True) if absent]
        raise NoReply(
            f"bus {self.settings.name}: the position of {', '.join(names)} is not known, for no answer came",
            hint="look at its cable, then start again",
        )

    def _needed(self) -> Flags:
        """Servos whose positions must be known."""
        return self.bus.driven & (not self.limp)

    def _run(self) -> None:
        self.realtime = request_realtime()
        try:
            for now in self.clock.run(lambda: not self._stopping.is_set()):
                self._tick(now)
            if not self.limp:
                self._come_to_rest()
        except Exception as error:  # noqa: BLE001  the body raises it and stops the servos
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
            log.warning("%s; trying again every %g s", error, _RETRY_NS / 1e9)
            self._retry_ns = 0

    def _stay_off(self, now: int) -> None:
        """Switch the servos off, again every second where some are not confirmed off, and only read their positions."""
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
                self.bus.reconnect()  # it only opens the port, for the bus is stopped
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
        if self._let_go and not self._take_again(angles):
            return
        self.held += held
        wanted = np.where(self._driven, angles, self._goals.sent)
        self.bus.write(self._goals.step(wanted, self._state, self.clock.step_s))
        if stamp > self._last_stamp:
            self._last_stamp = stamp
            self.latency_ms.add((time.monotonic_ns() - stamp) / 1e6)
        self._state = self.bus.read()
        self.following.add(angles, self._state)
        if self._letting_go.may_let_go(self._goals.sent, self._state, self.clock.step_s):
            self._release(angles, self._state)

    def _release(self, wanted: Floats, state: BusState) -> None:
        """Let the servos go; where that fails, they are started again as after a STOP."""
        try:
            self.bus.stop()
        except PortLost:
            self._off = True  # a bus that does not run is only opened again by reconnecting
            raise
        except DriverError as error:
            self._off = True
            self._try_later(time.monotonic_ns(), "not let go", error)
            return
        self._let_go = True
        self._letting_go.begin(wanted, state)
        log.info("bus %s: still, and let go", self.settings.name)

    def _take_again(self, wanted: Floats) -> bool:
        """Switch servos that were let go on again where they are, once a target or a servo moves; whether they are."""
        state = self._state = self.bus.read()
        if not self._letting_go.must_hold(wanted, state):
            return False
        self._let_go = False
        try:
            self.bus.start(partly=True)
            self._resume()
        except PortLost:
            self._off = True  # a bus that does not run is only opened again by reconnecting
            raise
        except DriverError as error:
            self._off = True  # as after a STOP: it is tried again
            self._try_later(time.monotonic_ns(), "not back", error)
            return False
        return True

    def _follow_absent(self) -> None:
        """Let the goals of servos that are not driven, or were not until the last read, begin where they are."""
        driven = self.bus.driven
        if driven is not self._driven or not driven.all():
            absent = ~(driven & self._driven)
            if self._state is not None:
                self._goals.restart_some(absent, self._state.position_rad)
            self._driven = driven

    def _come_to_rest(self) -> None:
        """Move the servos to the neutral face before torque is switched off, so that no part of the head drops."""
        rest = self.table.neutral_rad
        end_ns = time.monotonic_ns() + _REST_LIMIT_NS
        with suppress(DriverError):  # a bus that does not work is stopped as it is
            for now in Clock(self.settings.rate_hz).run(self._may_move):
                self._follow_absent()
                self.bus.write(self._goals.step(rest, self._state))
                state = self._state = self.bus.read()
                known = state.fresh | (not self.bus.measures)
                away = np.where(known, np.abs(state.position_rad - rest), np.where(self.bus.driven, np.inf, 0.0))
                if now > end_ns or away.max() < _AT_REST_RAD:
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

    def _try_later(self, now: int, what: str, error: DriverError) -> None:
        """Try again in a second; log why, once."""
        if str(error) != self._last_reason:
            self._last_reason = str(error)
            log.warning("bus %s is %s: %s", self.settings.name, what, error)
        self._retry_ns = now + _RETRY_NS

    def condition(self) -> dict[str, object]:
        """Its name, whether it drives its servos, and why it does not; for people who watch it, from any thread."""
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
            "let_go": {"times": self._letting_go.times, "sagged": self._letting_go.sagged},
            "linkages_out_of_reach": self._goals.out_of_reach(),
            "face_difference": self.following.report(),
            "bus": self.bus.report().as_dict(),
            "stopped_by": stopped.who if (stopped := self._stop_latch.stopped) else None,
            "fault": str(self.error) if self.error else None,
        }
