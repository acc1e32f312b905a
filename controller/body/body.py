"""The body: runs links, layers, motion limits and buses of a stage, in a separate control process.

The control loop computes parameters from commands at ``control_hz`` and publishes them; each bus drives its servos at
its own rate from the newest parameters. The process stops its servos safely whether it ends by a request, the end of
the main process, SIGTERM, or an error.
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
"""Function of a tick's time (ns) and length (s), the values (P,), which it may change in place, and the time (ns) of
the newest command in them; it returns the time of the newest command in the resulting values."""
_MAX_STEP_S = 0.1
"""Layers that paused for longer continue as after a step of this length."""


class Body:
    """Everything between the links and the servos of one head; publishes the parameters to ``mailbox``.

    member : what the head shares with the other heads of its stage, which
        :class:`controller.body.multi_head.MultiHeadBody` ticks; None for the only head of a stage.

    Attributes
    ----------
    relay : sends the mixed values to other processes, or replaces them by what a conductor sends; None without others.
    rests : returns whether the layers are not needed, because another process decides what is shown.
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
        self._unmixed_s = 0.0  # time since the layers ticked last
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
        self.state.live(liveliness, 0, stage.settings.manner)  # the time 0 means that no command set it
        self.links: list[LinkPart] = []
        self.buses = [loop for robot in stage.robots for loop in self._bus_loops(robot, parameters, options.mirror)]
        self.measured_face: MeasuredFace | None = None
        if self.buses:
            self.measured_face = MeasuredFace(
                [bus.table for bus in self.buses],
                [bus.measured for bus in self.buses],
                parameters,
                [bus.following for bus in self.buses],
                stage.vocabulary.faces(),
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
        self._nothing_to_follow = False
        self._panel = self.state.parts.add(Part("panel state", effect="the panel shows what it knew last"))
        self._thread = threading.Thread(target=self._control, name="control", daemon=True)

    def _make_shows(self, options: RunOptions, parameters: Parameters) -> None:
        """Create the player of shows and its event log; start the show that the options or the stage name."""
        events = None
        if options.events is not None:
            remedy = "the earlier events are kept; start again with -o on a disk that has space"
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
        """Create the sources: a take, a voice, or the servos of a head that is moved by hand.

        If links are open (no take in the options), the stage's own take and voice play beside them.
        """
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
        """Create the loops of a robot's buses; ``limp`` : keep the torque of all servos off."""
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
        remedy = "the earlier ticks are kept; begin another one with --record on a disk that has space"
        part = self.state.parts.add(Part(f"recording {path}", remedy=remedy))
        self._closers.enter_context(
            recorded(
                self.state, path, seed=seed, period_s=period_s,
                failed=lambda error: part.fail(error, time.monotonic()),
            )
        )  # fmt: skip

    def _find_show(self, name: str) -> Script:
        """Return the script that a command names. Raises ConfigError: there is none, or it is switched off."""
        stage = self.stage
        return self._as_part(load_named_script(name, self.state.parameters, stage.vocabulary, beside=stage.path))

    def _show_names(self) -> list[str]:
        return script_names(beside=self.stage.path)

    def _as_part(self, script: Script) -> Script:
        """Register a script as a part that fails separately, and return it. Raises ConfigError: it is switched off."""
        part = self.state.parts.add(show_part(script.name))
        if part.off:
            raise ConfigError(f"{part.name} failed too often and is switched off: {part.why}", hint="start omote again")
        return script

    def newest(self) -> tuple[Floats, int]:
        """Return the newest parameters and the arrival time (monotonic ns) of the newest command in them."""
        return self._newest

    @property
    def finished(self) -> bool:
        """Whether the take, the voice or the recording that the run plays has ended."""
        return self.sources.finished or (self.replay is not None and self.replay.finished)

    def start(self) -> None:
        """Start the buses, hold the servos where they are, and start the control loop.

        Raises DriverError: a port or servo cannot be started; those already started are stopped again.
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
        """Let the servos follow the face; open the links and start listening to a voice, or start the take.

        A link that cannot be opened is retried, unless no link can be opened and there is no other source: then the
        error of the first link is raised.
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
        """Open the links; see :meth:`begin` for those that cannot be opened."""
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
            except Exception as error:  # noqa: BLE001  raised below, or the link is retried
                faults.append((link, error))
        if faults and len(faults) == len(self.links) and not self.sources.any:
            raise faults[0][1]
        for link, fault in faults:
            link.fail(fault)

    def play_take(self, path: Path) -> None:
        """Play a take from its beginning, beside the links; if it cannot be read, only log the error."""
        try:
            self.sources.play(TakePlayer(load_take(path, self.state.parameters), self.state, reader_of(path).layer))
        except OMOTE_ERRORS as error:
            log.warning("%s", error)

    def jog(self, bus: str, servo: str, angle_deg: float | None) -> None:
        """Move a single servo, see :class:`controller.body.messages.Jog`."""
        for loop in self.buses:
            if loop.settings.name == bus:
                loop.jog(servo, None if angle_deg is None else math.radians(angle_deg))

    def end_jogs(self) -> None:
        """Let all servos follow the face again."""
        for loop in self.buses:
            loop.end_jogs()

    def details(self) -> Details:
        """Return what servos, links, buses and parts report now, and what was logged since the last call."""
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

    def _warn_if_nothing_to_follow(self) -> None:
        """Log an error once when parts have failed and no link or source is left for the face to follow."""
        follows = self.sources.playing or any(link.opened for link in self.links)
        nothing = self.live and self._begun.is_set() and not follows and bool(self.state.parts.failed)
        if nothing and not self._nothing_to_follow:
            log.error(
                "NOTHING IS LEFT TO FOLLOW: every link, take, voice and show has failed or ended; the face keeps its "
                "last commands and the servos hold them; see the messages above, then end it with Ctrl-C"
            )
        self._nothing_to_follow = nothing

    def check(self) -> None:
        """Raise the error that ended a loop, or the only source that was to be played."""
        self._warn_if_nothing_to_follow()
        for error in (self._error, self.sources.error, *(bus.error for bus in self.buses)):
            if error is not None:
                raise error

    def stop(self) -> None:
        """Close the links, then stop the servos; an error of one does not prevent the others from being stopped."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self._closers.close()

    def _control(self) -> None:
        request_realtime()  # otherwise a bus thread can wait for this thread while this one waits for a processor
        try:
            self._control_loop()
        except Exception as error:  # noqa: BLE001  check() raises it, and the servos are stopped
            self._error = error

    def _control_loop(self) -> None:
        for now in self.clock.run(lambda: not self._stopping.is_set()):
            self.tick(now, self.clock.step_s)

    def tick(self, now_ns: int, step_s: float) -> None:
        """Compute one step of the face from its sources and layers, and pass it to the buses and the picture."""
        begun, values = self._begun.is_set(), self._newest[0].copy()
        self.sources.tick(now_ns, begun)
        self._unmixed_s = min(self._unmixed_s + step_s, _MAX_STEP_S)
        stamp = 0
        if not self.rests():
            stamp = self._tick_layers(now_ns, self._unmixed_s, values, begun)
            self._unmixed_s = 0.0
        if self.relay is not None:
            stamp = self.relay(now_ns, step_s, values, stamp)
            self.state.show(values)
        is_new, self._newest = stamp > self._newest[1], (values, stamp)
        for bus in self.buses:
            bus.feed(step_s, urgent=is_new)
        shown = self.state if self.replay is None or not begun else self.replay
        self._mailbox.publish(values, stamp, shown.beside)

    def _tick_layers(self, now_ns: int, dt: float, values: Floats, begun: bool) -> int:
        """Write the face of the layers or of a recording to ``values`` : (P,); return the newest command's time (ns).

        After an error of a recording, ``values`` stay unchanged.
        """
        if self.replay is None or not begun:
            return self.state.tick(now_ns, dt, values)
        if self.sources.error is None:
            try:
                return self.replay.tick(now_ns, dt, values)
            except Exception as error:  # noqa: BLE001  check() raises it, after the servos were brought to rest
                self.sources.error = error
        return 0

    def report(self) -> dict[str, object]:
        """Return measurements of the control loop, sources, links and buses, and the parts that failed."""
        return {
            "control": self.clock.report(),
            **self.sources.report(),
            "links": [link.report() for link in self.links],
            "buses": [bus.report() for bus in self.buses],
            "parts": self.state.parts.report(),
        }
