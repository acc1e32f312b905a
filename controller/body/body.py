"""The body: links, layers, motion limits and buses, in a process of its own.

The control loop turns commands into parameters at ``control_hz`` and publishes them; each bus drives its servos
at its own rate from the newest ones. The process stops its servos safely on every way out: told to, main gone,
SIGTERM, or a fault of its own.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

from controller.base.clock import Clock
from controller.base.errors import OMOTE_ERRORS
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.base.signals import termination_signals, unblock_interrupts
from controller.body.messages import Begin, BodyOrders, Failed, Finished, Hold, Neutral, Ready, Report, Show
from controller.body.panel_state import PanelStateWriter, panel_state_size
from controller.body.sources import Sources, Voice
from controller.links.kind import Link, LinkContext
from controller.links.line.script import load_script
from controller.links.line.show import Shows
from controller.links.links import open_links
from controller.robot.busloop import BusLoop
from controller.robot.following import FollowMode, MeasuredFace
from controller.robot.settings import RobotSettings
from controller.stage.stage import Stage, load_stage
from controller.takes.livelink import Take, TakePlayer
from controller.takes.reader import load_take, reader_of
from controller.takes.recording import SUFFIX, Replay, recorded
from drivers.base.priority import request_realtime, shorten_thread_switches
from drivers.base.shutdown import Closers, combine_with_context

_POLL_S = 0.1


class Body:
    """Everything between the links and the wires of one stage.

    Parameters
    ----------
    stage : what to run.
    parameters : the vocabulary.
    mailbox : where the parameters are published, one per entry of ``parameters.names``.
    take, layer : a recorded take and the layer it is played into; None for none.
    mirror : leave the servos limp; the face shows where somebody moves them.
    voice : a voice that moves the mouth. record : file to write every command and tick to.
    replay : plays a recording instead of everything else.
    """

    def __init__(
        self,
        stage: Stage,
        parameters: Parameters,
        mailbox: Mailbox,
        take: Take | None = None,
        layer: str = "capture",
        *,
        mirror: bool = False,
        voice: Voice | None = None,
        record: Path | None = None,
        replay: Replay | None = None,
    ) -> None:
        self.stage = stage
        self._closers = Closers()
        self.state = stage.state(parameters)
        if record is not None:
            seed, period_s = stage.settings.seed, stage.period_s
            self._closers.enter_context(recorded(self.state, record, seed=seed, period_s=period_s))
        self.clock = Clock(stage.settings.control_hz)
        self.state.live(0.0 if mirror else stage.settings.liveliness, 0)  # no command: it has no time of arrival
        self.replay = replay
        self.links: list[Link] = []
        self.buses = [loop for robot in stage.robots for loop in self._loops(robot, parameters, mirror)]
        self.reflection = self._measured_face(parameters)
        self.state.servo_monitor = self.reflection
        self.state.shows = Shows(
            lambda name: load_script(name, parameters, stage.vocabulary, beside=stage.path), self.state
        )
        if stage.settings.show is not None:
            self.state.shows.start(stage.settings.show)
        self.puppet = FollowMode(self.reflection, parameters) if mirror and self.reflection is not None else None
        self.live = take is None and replay is None
        if self.live:
            take, layer, voice = _own(stage, parameters, voice)
        player = TakePlayer(take, self.state, layer) if take is not None else None
        self.sources = Sources(self.state, player, self.puppet, voice, beside=self.live)
        self._mailbox = mailbox
        self._newest: tuple[Floats, int] = (parameters.neutral(), 0)
        self._stopping = threading.Event()
        self._begun = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._control, name="control", daemon=True)

    def _measured_face(self, parameters: Parameters) -> MeasuredFace | None:
        buses = self.buses
        if not buses:
            return None
        return MeasuredFace(
            [b.table for b in buses], [b.measured for b in buses], parameters, [b.following for b in buses]
        )

    def _loops(self, robot: RobotSettings, parameters: Parameters, limp: bool) -> list[BusLoop]:
        anchors = None
        if any(channel.anchor is not None for channel in robot.channels):
            from controller.robot.anchors import load_anchors  # start-up: loads the head

            anchors = load_anchors(robot, self.stage.head, parameters)
        return [
            BusLoop(bus, robot.on_bus(bus.name), parameters, self.newest, robot.rules, anchors, limp=limp)
            for bus in robot.buses
        ]

    def newest(self) -> tuple[Floats, int]:
        """The newest parameters and the arrival time (monotonic ns) of the command behind them."""
        return self._newest

    @property
    def finished(self) -> bool:
        """True once there is nothing left to play."""
        return self.sources.finished or (self.replay is not None and self.replay.finished)

    def start(self) -> None:
        """Bring the servos up where they stand, and keep them there.

        Raises
        ------
        DriverError
            when a port or servo does not come up; what was up is shut down again.
        """
        try:
            for bus in self.buses:
                bus.start()
                self._closers.callback(bus.stop)
            self._thread.start()
        except BaseException:
            self._closers.close()
            raise

    def begin(self) -> None:
        """Let the servos follow; open the links, or start the take.

        Raises
        ------
        LinkError, PortError
            when a link does not come up.
        """
        if self.live:
            links = [link for link in self.stage.settings.links if self.puppet is None or link.simulated is None]
            context = LinkContext(self.state, self._closers, self.stage.vocabularies, self.stage.path)
            self.links = open_links(links, context)
            self._closers.callback(self.sources.stop)
            self.sources.begin()
        for bus in self.buses:
            bus.begin()
        self._begun.set()

    def check(self) -> None:
        """Raise what ended one of the loops, if any did."""
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
        except Exception as error:  # noqa: BLE001  the body has to hear of it and stop the servos
            self._error = error

    def _control_loop(self) -> None:
        values = self._newest[0].copy()
        period, ticked = self.clock.period_ns, 0
        for now in self.clock.run(lambda: not self._stopping.is_set()):
            begun = self._begun.is_set()
            self.sources.tick(now, begun)
            # whole periods, those that were skipped with them: a tick that is a little late is no uneven motion
            steps = 1 + self.clock.skipped - ticked
            ticked = self.clock.skipped
            face = self.replay if self.replay is not None and begun else self.state
            stamp = face.tick(now, steps * period / 1e9, values)
            self._newest = (values.copy(), stamp)
            self._mailbox.publish(values, stamp)

    def report(self) -> dict[str, object]:
        """What was measured by the control loop, the links and the buses."""
        return {
            "control": self.clock.report(),
            **self.sources.report(),
            "links": [link.report() for link in self.links],
            "buses": [bus.report() for bus in self.buses],
        }


def _own(stage: Stage, parameters: Parameters, voice: Voice | None) -> tuple[Take | None, str, Voice | None]:
    """What a stage plays by itself: its take, the take's layer, and its voice unless there is one already."""
    settings, take, layer = stage.settings, None, "capture"
    if settings.take is not None:
        path = stage.file(settings.take)
        take, layer = load_take(path, parameters), reader_of(path).layer
    if voice is None and settings.voice is not None:
        voice = Voice(str(stage.file(settings.voice)), settings.voice_hz)
    return take, layer, voice


def body_main(orders: BodyOrders, pipe: Connection) -> None:
    """Entry of the body's process.

    Parameters
    ----------
    orders : what to do.
    pipe : to main: one :class:`Ready` or :class:`Failed`, perhaps :class:`Finished`, at the end a
        :class:`Report`. Main may send what its panel wants; ``Stop`` and main's own end both mean stop.
    """
    stop = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; main tells the body when
    unblock_interrupts()
    for ending in termination_signals():
        signal.signal(ending, lambda *_: stop.set())
    try:
        _serve(orders, pipe, stop)
    except OMOTE_ERRORS as error:
        all_told = combine_with_context(error)
        _tell(pipe, Failed(str(all_told), getattr(all_told, "hint", "")))
    except Exception as error:
        if os.environ.get("OMOTE_DEBUG"):
            raise
        _tell(pipe, Failed(f"the body process failed: {type(error).__name__}: {error}"))


def _serve(orders: BodyOrders, pipe: Connection, stop: threading.Event) -> None:
    parameters = PARAMETERS
    stage = load_stage(orders.stage, parameters)
    mailbox = _reached(orders.mailbox, len(parameters.names))
    insights = None if orders.insight is None else _reached(orders.insight, panel_state_size(parameters))
    body = _body(orders, stage, mailbox, parameters)
    shorten_thread_switches()  # before torque: what collects garbage later finds little to look at
    body.start()
    try:
        _tell(pipe, Ready())
        _wait(body, pipe, stop, _panel_state(insights, body))
    finally:
        body.stop()
    _tell(pipe, Report(body.report()))


def _reached(path: str, count: int) -> Mailbox:
    """A mailbox of main's, which nobody else has to find from now on."""
    mailbox = Mailbox(path, count)
    mailbox.unlink()
    return mailbox


def _body(orders: BodyOrders, stage: Stage, mailbox: Mailbox, parameters: Parameters) -> Body:
    record = Path(orders.record) if orders.record else None
    if orders.take is None:
        return Body(stage, parameters, mailbox, mirror=orders.mirror, voice=orders.voice, record=record)
    path = Path(orders.take)
    if path.suffix == SUFFIX:
        return Body(stage, parameters, mailbox, replay=Replay(path, parameters, stage.state))
    return Body(stage, parameters, mailbox, load_take(path, parameters), reader_of(path).layer, record=record)


def _panel_state(insights: Mailbox | None, body: Body) -> Callable[[], None]:
    """What tells main, now and then, more than the values."""
    if insights is None:
        return lambda: None
    return PanelStateWriter(insights, body.state, body.reflection).publish


def _wait(body: Body, pipe: Connection, stop: threading.Event, publish: Callable[[], None]) -> None:
    """Serve main until it says stop or is gone, a signal comes, or a bus gave up."""
    told = False
    while not stop.is_set():
        if pipe.poll(_POLL_S) and not _handle(body, pipe):
            return
        publish()
        if body.finished and not told:
            _tell(pipe, Finished())
            told = True
        body.check()


def _handle(body: Body, pipe: Connection) -> bool:
    """Do what main or its panel wants; False when it said stop or is gone."""
    try:
        request = pipe.recv()
    except (EOFError, OSError):
        return False
    state, now = body.state, time.monotonic_ns()
    match request:
        case Begin():
            shorten_thread_switches()
            request_realtime()  # the links' threads too: one put off while it holds the interpreter puts off the servos
            body.begin()
        case Hold(index, None):
            state.release([index], now)
        case Hold(index, float(value)):
            state.set_parameters([index], [value], now)
        case Show(name, intensity):
            state.expression(name, intensity, None, now)
        case Neutral(seconds):
            state.neutral(seconds, now)
        case _:
            return False
    return True


def _tell(pipe: Connection, message: object) -> None:
    with suppress(OSError):  # main is gone; the servos are stopped all the same
        pipe.send(message)
