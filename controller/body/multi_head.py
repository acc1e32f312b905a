"""The body of a stage with several heads: one control loop for all of them, and one latch that stops all servos."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from controller.base.linked_clocks import HurriedClock
from controller.base.mailboxes import Mailbox
from controller.base.parameters import Parameters
from controller.base.stop_latch import StopLatch
from controller.body.body import Body
from controller.body.member import Member, options_of
from controller.body.messages import RunOptions
from controller.body.panel_state import PanelState
from controller.layers.commands import CommandState
from controller.layers.heads import Heads, Turns
from controller.stage.stage import Stage
from drivers.base.priority import request_realtime


class MultiHeadBody:
    """The bodies of several heads, ticked together; it has the same methods as :class:`controller.body.body.Body`.

    mailboxes, panels : one for each head of the stage, in its order.

    Attributes
    ----------
    bodies : of the heads, in the order of the stage. heads : their layers by name.
    """

    def __init__(
        self,
        stage: Stage,
        parameters: Parameters,
        mailboxes: Sequence[Mailbox],
        panels: Sequence[PanelState] = (),
        options: RunOptions = RunOptions(),
    ) -> None:
        self.stage, self._panels = stage, panels
        self.clock = HurriedClock(stage.settings.control_hz)
        self.heads, latch = Heads(stage.settings.head_groups), StopLatch()
        self.bodies = []
        for i, (head, mailbox) in enumerate(zip(stage.heads, mailboxes, strict=True)):
            member = Member(head.name, head.placement, self.heads, self.clock, latch)
            own = options_of(options, head.name, first=i == 0)
            self.bodies.append(Body(head.stage, parameters, mailbox, own, member))
        self.heads.turns = Turns(self.heads, auto=stage.settings.turns == "auto")
        self._stopping = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._control, name="control", daemon=True)

    @property
    def state(self) -> CommandState:
        """The layers of the first head, which takes every command that names no head."""
        return self.bodies[0].state

    def body_of(self, name: str) -> Body:
        """The body of the head of a name; that of the first one where there is none."""
        return next((body for body in self.bodies if body.state.name == name), self.bodies[0])

    @property
    def live(self) -> bool:
        """Whether links move the faces."""
        return self.bodies[0].live

    @property
    def finished(self) -> bool:
        """Whether every take, show and voice has been played to its end."""
        return self.bodies[0].finished

    def start(self) -> None:
        """Start all servos and hold them where they are. Raises DriverError; those already started are stopped then."""
        started: list[Body] = []
        try:
            for body in self.bodies:
                body.start()
                started.append(body)
            self._thread.start()
        except BaseException:
            for body in reversed(started):
                body.stop()
            raise

    def begin(self) -> None:
        """Let the servos follow the faces, and open the links.

        Raises the error of a link that cannot be opened where its head has nothing else to follow.
        """
        for body in self.bodies:
            body.begin()

    def publish(self, panel_state: object = None) -> None:
        """Write the state of every head to the mailbox of its panel."""
        for body, panel in zip(self.bodies, self._panels, strict=False):
            body.publish(panel)

    def check(self) -> None:
        """Raise the error that ended the control loop, or that ended the only thing that a head had to play."""
        if self._error is not None:
            raise self._error
        for body in self.bodies:
            body.check()

    def stop(self) -> None:
        """Close all links, then stop all servos; errors of one head do not keep the others from being stopped."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        errors = [error for body in self.bodies if (error := _stopped(body)) is not None]
        if errors:
            raise errors[0]

    def report(self) -> dict[str, object]:
        """The report of a body for all heads; every link, bus and part also names its head."""
        reports = [(body.state.name, body.report()) for body in self.bodies]
        lists = {
            key: [{"head": name, **each} for name, report in reports for each in report[key]]  # type: ignore[attr-defined]
            for key in ("links", "buses", "parts")
        }
        heads = [_place(body) for body in self.bodies]
        return {**reports[0][1], "control": self.clock.report(), **lists, "heads": heads}

    def _control(self) -> None:
        request_realtime()
        try:
            for now in self.clock.run(lambda: not self._stopping.is_set()):
                self.tick(now, self.clock.step_s)
        except Exception as error:  # noqa: BLE001  check() raises it, and the servos are stopped
            self._error = error

    def tick(self, now_ns: int, step_s: float) -> None:
        """One step of every head, after one of the turn-taking between them."""
        if self.heads.turns is not None:
            self.heads.turns.tick(now_ns)
        for body in self.bodies:
            body.tick(now_ns, step_s)


def _stopped(body: Body) -> Exception | None:
    try:
        body.stop()
    except Exception as error:  # noqa: BLE001  the others are stopped first
        return error
    return None


def _place(body: Body) -> dict[str, object]:
    """Name, place and turn of a head, for the report."""
    place = body.state.placement
    return {"head": body.state.name, "position_mm": list(place.position_mm), "yaw_deg": place.yaw_deg,
            "ticks": body.state.status()["ticks"]}  # fmt: skip
