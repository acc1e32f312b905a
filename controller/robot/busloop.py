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
from controller.base.parameters import Floats, Parameters
from controller.robot.buses import BusSettings
from controller.robot.channels import servo_specs
from controller.robot.following import FollowingStatistics
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
    limp : switch the motors off and only read the positions of the servos.
    feed_s : time between calls of :meth:`feed`, after which cycles begin; 0 for a bus that cycles by itself.
    """

    def __init__(
        self,
        settings: BusSettings,
        channels: Sequence[ChannelSettings],
        parameters: Parameters,
        newest: Newest,
        rules: RuleSettings = RuleSettings(),
        anchors: AnchorSolver | None = None,
        *,
        limp: bool = False,
        feed_s: float = 0.0,
    ) -> None:
        self.settings = settings
        self._goals = GoalFilter(channels, parameters, rules, 1.0 / settings.rate_hz, anchors)
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
        self._newest = newest
        self._last_stamp = 0
        self._retry_ns: int | None = None  # when to try a lost port again; None while there is one
        self._state: BusState | None = None
        self._stopping, self._begun = threading.Event(), threading.Event()
        self._last_reason = ""
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the bus, start the servos safely and begin to drive them.

        Raises DriverError when the port or a servo does not come up; the bus is closed again.
        """
        try:
            self.bus.open()
            self.bus.start()
            if self.limp:
                self.bus.stop()
                if not self.bus.measures:
                    log.warning("bus %s does not measure its servos: the face cannot follow", self.settings.name)
            self._resume()
        except BaseException:
            self.bus.close()
            raise
        self._thread = threading.Thread(target=self._run, name=f"bus {self.settings.name}", daemon=True)
        self._thread.start()

    def feed(self, step_s: float, *, urgent: bool) -> None:
        """Report new parameters, ``step_s`` after the last ones; the next cycle begins with urgent ones."""
        self.clock.feed(step_s, urgent=urgent)

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

    def _resume(self) -> None:
        """Continue from where the servos are, so that the first goals are a ramp from there."""
        self._goals.restart(self._all_fresh().position_rad)

    def _all_fresh(self) -> BusState:
        """Read until every servo has answered; raises NoReply when some do not: old positions are unsafe to use."""
        for _ in range(_READS):
            state = self._state = self.bus.read()
            if state.fresh.all() or not self.bus.measures:
                return state
        names = [name for name, fresh in zip(self.table.names, state.fresh, strict=True) if not fresh]
        raise NoReply(
            f"bus {self.settings.name}: the position of {', '.join(names)} is not known, for no answer came",
            hint="look at its cable, then start again",
        )

    def _run(self) -> None:
        self.realtime = request_realtime()
        try:
            for now in self.clock.run(lambda: not self._stopping.is_set()):
                if self._retry_ns is None:
                    self._cycle()
                elif now >= self._retry_ns:
                    self._reconnect(now)
            if not self.limp:
                self._come_to_rest()
        except Exception as error:  # noqa: BLE001  the body raises it and stops the servos
            self.error = error

    def _cycle(self) -> None:
        try:
            if self.limp:
                self._state = self.bus.read()
            else:
                self._drive()
        except PortLost as error:
            log.warning("%s; trying again every %g s", error, _RETRY_NS / 1e9)
            self._retry_ns = 0

    def _drive(self) -> None:
        if not self._begun.is_set():
            self.bus.write(self._goals.sent)
            self._state = self.bus.read()
            return
        values, stamp = self._newest()
        angles, held = self.table.angles(values)
        self.held += held
        self.bus.write(self._goals.step(angles, self._state, self.clock.step_s))
        if stamp > self._last_stamp:
            self._last_stamp = stamp
            self.latency_ms.add((time.monotonic_ns() - stamp) / 1e6)
        self._state = self.bus.read()
        self.following.add(angles, self._state)

    def _come_to_rest(self) -> None:
        """Move the servos to the neutral face before torque is switched off, so that no part of the head drops."""
        rest = self.table.neutral_rad
        end_ns = time.monotonic_ns() + _REST_LIMIT_NS
        with suppress(DriverError):  # a bus that does not work is stopped as it is
            for now in Clock(self.settings.rate_hz).run(lambda: self._retry_ns is None):
                self.bus.write(self._goals.step(rest, self._state))
                state = self._state = self.bus.read()
                known = state.fresh | (not self.bus.measures)
                away = np.where(known, np.abs(state.position_rad - rest), np.inf)
                if now > end_ns or away.max() < _AT_REST_RAD:
                    return

    def _reconnect(self, now: int) -> None:
        """Try once to get a lost port back; motion continues from the measured positions."""
        try:
            self.bus.reconnect()
            self._resume()
        except DriverError as error:
            if str(error) != self._last_reason:
                self._last_reason = str(error)
                log.warning("bus %s is not back: %s", self.settings.name, error)
            self._retry_ns = now + _RETRY_NS
        else:
            log.warning("bus %s is back", self.settings.name)
            self._retry_ns = None

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
            "face_difference": self.following.report(),
            "bus": self.bus.report().as_dict(),
            "fault": str(self.error) if self.error else None,
        }
