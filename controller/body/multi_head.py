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
    """The bodies of several heads, which it ticks together; has the methods of :class:`controller.body.body.Body`.

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
        """The layers of the first head, which receives every command that names no head."""
        return self.bodies[0].state

    def body_of(self, name: str) -> Body:
        """Return the body of the head called ``name``, or of the first head if there is none."""
        return next((body for body in self.bodies if body.state.name == name), self.bodies[0])

    @property
    def live(self) -> bool:
        """Whether links move the faces."""
        return self.bodies[0].live

    @property
    def finished(self) -> bool:
        """Whether the sources of the first head, which plays all takes and voices, have ended."""
        return self.bodies[0].finished

    def start(self) -> None:
        """Start all servos and hold them where they are. Raises DriverError; then started servos are stopped again."""
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

        Raises the error of a link that cannot be opened if its head has no other link or source.
        """
        for body in self.bodies:
            body.begin()

    def publish(self, panel_state: object = None) -> None:
        """Write the state of every head to the mailbox of its panel."""
        for body, panel in zip(self.bodies, self._panels, strict=False):
            body.publish(panel)

    def check(self) -> None:
        """Raise the error that ended the control loop, a bus loop, or the only source that was to be played."""
        if self._error is not None:
            raise self._error
        for body in self.bodies:
            body.check()

    def stop(self) -> None:
        """Stop the heads one by one: close the links and stop the servos of each, also after an error of another.

        Raises the first error.
        """
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        errors = [error for body in self.bodies if (error := _stop_body(body)) is not None]
        if errors:
            raise errors[0]

    def report(self) -> dict[str, object]:
        """Return one report for all heads; every link, bus and part in it also names its head."""
        reports = [(body.state.name, body.report()) for body in self.bodies]
        lists = {
            key: [{"head": name, **each} for name, report in reports for each in report[key]]  # type: ignore[attr-defined]
            for key in ("links", "buses", "parts")
        }
        heads = [_head_report(body) for body in self.bodies]
        return {**reports[0][1], "control": self.clock.report(), **lists, "heads": heads}

    def _control(self) -> None:
        request_realtime()
        try:
            for now in self.clock.run(lambda: not self._stopping.is_set()):
                self.tick(now, self.clock.step_s)
        except Exception as error:  # noqa: BLE001  check() raises it, and the servos are stopped
            self._error = error

    def tick(self, now_ns: int, step_s: float) -> None:
        """Tick the turn-taking between the heads, then every head."""
        if self.heads.turns is not None:
            self.heads.turns.tick(now_ns)
        for body in self.bodies:
            body.tick(now_ns, step_s)


def _stop_body(body: Body) -> Exception | None:
    try:
        body.stop()
    except Exception as error:  # noqa: BLE001  returned, because the other bodies are stopped first
        return error
    return None


def _head_report(body: Body) -> dict[str, object]:
    """Return name, position, direction and number of ticks of a head."""
    place = body.state.placement
    return {"head": body.state.name, "position_mm": list(place.position_mm), "yaw_deg": place.yaw_deg,
            "ticks": body.state.status()["ticks"]}  # fmt: skip
