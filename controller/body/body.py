"""The body: runs links, layers, motion limits and buses of a stage, in a separate process.

The control loop turns commands into parameters at ``control_hz`` and publishes them; each bus drives its servos at its
own rate from the newest ones. The process stops its servos safely however it ends: a request to stop, the end of the
main process, SIGTERM, or an error in this process.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

from controller.base.errors import OMOTE_ERRORS, ConfigError
from controller.base.linked_clocks import HurriedClock
from controller.base.mailboxes import Mailbox
from controller.base.parameters import Floats, Parameters
from controller.base.parts import Part
from controller.body.details import Notes
from controller.body.event_log import EventLog
from controller.body.link_part import LinkPart, link_status, thread_errors
from controller.body.member import Member
from controller.body.messages import Details, RunOptions
from controller.body.panel_state import PanelState
from controller.body.sources import Sources, Voice, show_part
from controller.links.kind import LinkContext
from controller.links.line.script import Script, load_named_script, load_script, script_names
from controller.links.line.show import Shows
from controller.robot.busloop import BusLoop
from controller.robot.following import MeasuredFace
from controller.robot.servo_states import servo_states
from controller.robot.settings import RobotSettings
from controller.stage.stage import Stage
from controller.takes.livelink import TakePlayer
from controller.takes.reader import load_take, reader_of
from controller.takes.recording import SUFFIX, Replay, recorded
from drivers.base.priority import request_realtime
from drivers.base.shutdown import Closers

log = logging.getLogger(__name__)


Relay = Callable[[int, float, Floats, int], int]
"""Gets the time of a tick (ns), its length (s), the values (P,), which it may change, and the time of the newest
command in them; returns the time of the newest command in what it left."""
_LONGEST_STEP_S = 0.1
"""Layers that rested for longer go on as after a step of this length."""


class Body:
    """Everything between the links and the servos of one head; publishes the parameters to ``mailbox``.

    member : set where this is one of several heads, all of which
        :class:`controller.body.multi_head.MultiHeadBody` ticks; None where it is the only head.

    Attributes
    ----------
    relay : passes on what was mixed to other processes, or replaces it by what they want; None where there are none.
    rests : whether the layers are not needed, because another process decides what is shown.
    """

    def __init__(
        self,
        stage: Stage,
        parameters: Parameters,
        mailbox: Mailbox,
        options: RunOptions = RunOptions(),
        member: Member | None = None,
    ) -> None:
        self.stage, self._member = stage, member
        self.relay: Relay | None = None
        self._unmixed_s = 0.0  # since the layers ticked last
        self.rests: Callable[[], bool] = lambda: False
        self._closers, self.notes = Closers(), Notes()
        self.state = stage.state(parameters)
        if member is not None:
            member.join(self.state)
        path, self.replay = options.take, None
        if path is not None and path.suffix == SUFFIX:
            self.replay = Replay(path, parameters, stage.state)
        elif options.record is not None:
            self._record(options.record)
        self.clock = HurriedClock(stage.settings.control_hz) if member is None else member.clock
        self.state.on_command = self.clock.hurry
        liveliness = 0.0 if options.mirror else stage.settings.liveliness
        self.state.live(liveliness, 0, stage.settings.manner)  # 0: no command set it
        self.links: list[LinkPart] = []
        self.buses = [loop for robot in stage.robots for loop in self._bus_loops(robot, parameters, options.mirror)]
        self.measured_face: MeasuredFace | None = None
        if self.buses:
            self.measured_face = MeasuredFace(
                [bus.table for bus in self.buses],
                [bus.measured for bus in self.buses],
                parameters,
                [bus.following for bus in self.buses],
            )
        self.state.servo_monitor = self.measured_face
        self.state.servo_records = lambda: [record for bus in self.buses for record in servo_states(bus)]
        self._make_shows(options, parameters)
        self._web = options.web
        self.follows_servos = options.mirror and self.measured_face is not None
        self.live = path is None
        self.sources = self._make_sources(options, parameters)
        self._mailbox = mailbox
        self._newest: tuple[Floats, int] = (parameters.neutral(), 0)
        self._stopping, self._begun = threading.Event(), threading.Event()
        self._error: Exception | None = None
        self._lost = False  # nothing is left to follow
        self._panel = self.state.parts.add(Part("panel state", effect="the panel shows what it knew last"))
        self._thread = threading.Thread(target=self._control, name="control", daemon=True)

    def _make_shows(self, options: RunOptions, parameters: Parameters) -> None:
        """What plays scripts and keeps their events; the show that the options or the stage name begins."""
        events = None
        if options.events is not None:
            remedy = "what came before is in it; start again with -o on a disk that has space"
            part = self.state.parts.add(Part(f"events {options.events}", remedy=remedy))
            events = EventLog(options.events, lsl=options.lsl, failed=lambda error: part.fail(error, time.monotonic()))
            self._closers.callback(events.close)
        shows = Shows(self._find_show, self.state, self._show_names, events.note if events is not None else None)
        self.state.shows = shows
        show = self.stage.settings.show if options.show is None else str(options.show)
        if show is not None:
            script = load_script(show, parameters, self.stage.vocabulary, beside=self.stage.path)
            shows.play(self._as_part(script))

    def _make_sources(self, options: RunOptions, parameters: Parameters) -> Sources:
        """A take, a voice or the servos that the face follows; those of a live stage play beside its links."""
        path, voice, settings = options.take, options.voice, self.stage.settings
        if self.live:
            path = self.stage.file(settings.take) if settings.take is not None else None
            if voice is None and settings.voice is not None:
                voice = Voice(str(self.stage.file(settings.voice)), settings.voice_hz)
        player = None
        if path is not None and self.replay is None:
            player = TakePlayer(load_take(path, parameters), self.state, reader_of(path).layer)
        follow = self.measured_face if self.follows_servos else None
        return Sources(self.state, player, follow, voice, beside=self.live)

    def _bus_loops(self, robot: RobotSettings, parameters: Parameters, limp: bool) -> list[BusLoop]:
        anchors = None
        if robot.anchored_channels:
            from controller.robot.anchors import load_anchors  # imported lazily: it loads the head

            anchors = load_anchors(robot, self.stage.head, parameters)
        prefix = f"{self.state.name}/" if self._member is not None else ""
        prefix += f"{robot.name}/" if len(self.stage.robots) > 1 else ""  # so that all buses have different names
        return [
            BusLoop(
                bus.model_copy(update={"name": prefix + bus.name}), robot.on_bus(bus.name), parameters, self.newest,
                robot.rules, anchors, robot.linkages_on(bus.name),
                limp=limp, feed_s=self.stage.period_s, stop_latch=self.state.stop_latch,
            )
            for bus in robot.buses
        ]  # fmt: skip

    def _record(self, path: Path) -> None:
        seed, period_s = self.stage.settings.seed, self.stage.period_s
        remedy = "what came before is in it; begin another with --record on a disk that has space"
        part = self.state.parts.add(Part(f"recording {path}", remedy=remedy))
        self._closers.enter_context(
            recorded(
                self.state, path, seed=seed, period_s=period_s,
                failed=lambda error: part.fail(error, time.monotonic()),
            )
        )  # fmt: skip

    def _find_show(self, name: str) -> Script:
        """The script that a robot asks for by name. Raises ConfigError: there is none, or it was switched off."""
        stage = self.stage
        return self._as_part(load_named_script(name, self.state.parameters, stage.vocabulary, beside=stage.path))

    def _show_names(self) -> list[str]:
        return script_names(beside=self.stage.path)

    def _as_part(self, script: Script) -> Script:
        """The script, as a part that fails alone. Raises ConfigError: it was switched off."""
        part = self.state.parts.add(show_part(script.name))
        if part.off:
            raise ConfigError(f"{part.name} failed too often and is switched off: {part.why}", hint="start omote again")
        return script

    def newest(self) -> tuple[Floats, int]:
        """The newest parameters and the arrival time (monotonic ns) of the command that caused them."""
        return self._newest

    @property
    def finished(self) -> bool:
        """True once there is nothing left to play."""
        return self.sources.finished or (self.replay is not None and self.replay.finished)

    def start(self) -> None:
        """Bring the servos up and hold them where they are.

        Raises DriverError when a port or servo does not come up; what was up is shut down again.
        """
        try:
            for bus in self.buses:
                bus.start()
                self._closers.callback(bus.stop)
            if self._member is None:
                self._thread.start()
        except BaseException:
            self._closers.close()
            raise

    def begin(self) -> None:
        """Let the servos follow; open the links, or start the take.

        Raises what the first link raises where none comes up and nothing else plays; otherwise a link that does not
        come up is tried again.
        """
        if self.live:
            self._closers.enter_context(thread_errors(lambda: self.links, self.state.parts))
            self._open_links()
            self._closers.callback(self.sources.stop)
            self.sources.begin()
        for bus in self.buses:
            bus.begin()
        self._begun.set()

    def _open_links(self) -> None:
        """Open the links; those that do not come up are tried again, unless there is nothing else to follow."""
        stage, state = self.stage, self.state

        def context(closers: Closers) -> LinkContext:
            return LinkContext(state, closers, stage.vocabularies, stage.path, stage.head)

        links = [*stage.settings.links, *([self._web.link()] if self._web is not None else [])]
        choices = [link for link in links if not self.follows_servos or link.simulated is None]
        self.links = [LinkPart(choice, context, state.parts) for choice in choices]
        state.link_status = lambda: link_status(self.links)
        state.link_records = lambda: [link.report() for link in self.links]
        faults: list[tuple[LinkPart, Exception]] = []
        for link in self.links:
            self._closers.callback(link.close)
            try:
                link.open()
            except Exception as error:  # noqa: BLE001  raised below, or tried again
                faults.append((link, error))
        if faults and len(faults) == len(self.links) and not self.sources.any:
            raise faults[0][1]
        for link, fault in faults:
            link.fail(fault)

    def play_take(self, path: Path) -> None:
        """Play a take from its beginning, beside the links; one that cannot be read is logged and changes nothing."""
        try:
            self.sources.play(TakePlayer(load_take(path, self.state.parameters), self.state, reader_of(path).layer))
        except OMOTE_ERRORS as error:
            log.warning("%s", error)

    def jog(self, bus: str, servo: str, angle_deg: float | None) -> None:
        """Turn a servo by hand, see :class:`controller.body.messages.Jog`."""
        for loop in self.buses:
            if loop.settings.name == bus:
                loop.jog(servo, None if angle_deg is None else math.radians(angle_deg))

    def end_jogs(self) -> None:
        """Let all servos follow the face again."""
        for loop in self.buses:
            loop.end_jogs()

    def details(self) -> Details:
        """What servos, links, buses and parts report now, and what was logged since the last time."""
        overview = self.state.overview()
        return Details(
            servos=overview["servos"],
            links=[link.record() for link in self.links],
            buses=[loop.condition() for loop in self.buses],
            parts=self.state.parts.report(),
            notes=self.notes.take(),
        )

    def publish(self, panel_state: PanelState) -> None:
        """Write the state for the panel."""
        self._panel.run(lambda: panel_state.publish(self.state, self.measured_face), time.monotonic())

    def _look_for_something_to_follow(self) -> None:
        """Say once when parts have failed and nothing is left that the face could follow."""
        follows = self.sources.playing or any(link.opened for link in self.links)
        lost = self.live and self._begun.is_set() and not follows and bool(self.state.parts.failed)
        if lost and not self._lost:
            log.error(
                "NOTHING IS LEFT TO FOLLOW: every link, take, voice and show has failed or ended; the face keeps its "
                "last commands and the servos hold them; see the messages above, then end it with Ctrl-C"
            )
        self._lost = lost

    def check(self) -> None:
        """Raise the error that ended one of the loops, or the only thing there was to play."""
        self._look_for_something_to_follow()
        for error in (self._error, self.sources.error, *(bus.error for bus in self.buses)):
            if error is not None:
                raise error

    def stop(self) -> None:
        """Close links, then stop the servos; errors of one do not keep the others from being stopped."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self._closers.close()

    def _control(self) -> None:
        request_realtime()  # else a servo's thread waits for this one while that waits for a processor
        try:
            self._control_loop()
        except Exception as error:  # noqa: BLE001  check() raises it, and the servos are stopped
            self._error = error

    def _control_loop(self) -> None:
        for now in self.clock.run(lambda: not self._stopping.is_set()):
            self.tick(now, self.clock.step_s)

    def tick(self, now_ns: int, step_s: float) -> None:
        """One step of the face: its sources, the layers, and what of it the buses and the picture get."""
        begun, values = self._begun.is_set(), self._newest[0].copy()
        self.sources.tick(now_ns, begun)
        self._unmixed_s = min(self._unmixed_s + step_s, _LONGEST_STEP_S)
        stamp = 0
        if not self.rests():
            stamp = self._tick(now_ns, self._unmixed_s, values, begun)
            self._unmixed_s = 0.0
        if self.relay is not None:
            stamp = self.relay(now_ns, step_s, values, stamp)
            self.state.show(values)
        is_new, self._newest = stamp > self._newest[1], (values, stamp)
        for bus in self.buses:
            bus.feed(step_s, urgent=is_new)
        self._mailbox.publish(values, stamp)

    def _tick(self, now_ns: int, dt: float, values: Floats, begun: bool) -> int:
        """Write the face of this tick to ``values`` : (P,); a recording that cannot be played on leaves it as it is."""
        if self.replay is None or not begun:
            return self.state.tick(now_ns, dt, values)
        if self.sources.error is None:
            try:
                return self.replay.tick(now_ns, dt, values)
            except Exception as error:  # noqa: BLE001  check() raises it; the servos are led to rest first
                self.sources.error = error
        return 0

    def report(self) -> dict[str, object]:
        """Measurements of the control loop, the links and the buses, and the parts that failed."""
        return {
            "control": self.clock.report(),
            **self.sources.report(),
            "links": [link.report() for link in self.links],
            "buses": [bus.report() for bus in self.buses],
            "parts": self.state.parts.report(),
        }
