"""Running a stage: the body in its own process, the face in this one."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from controller.base.errors import ControllerError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import Parameters
from controller.body.messages import Begin, BodyOrders, Failed, Finished, Hold, Neutral, Ready, Report, Show, Stop
from controller.body.panel_state import PanelState, panel_state_size
from controller.body.preload import PreloadedBody
from controller.body.sources import Voice, pump
from controller.layers.mixer import by_priority
from controller.stage.stage import Stage

_START_TIMEOUT_S = 60.0
_STOP_TIMEOUT_S = 30.0
_TERMINATE_TIMEOUT_S = 5.0


class BodyProcess:
    """The body as main sees it; a context manager that always stops it.

    Parameters
    ----------
    stage : what to run.
    parameters : the vocabulary.
    take : a recorded take to play instead of the links.
    mirror : leave the servos limp; the face shows where somebody moves them.
    voice : a voice that moves the mouth. record : file to write every command and tick to.
    waiting : a process that waits for orders; without one it is started here.
    """

    def __init__(
        self,
        stage: Stage,
        parameters: Parameters,
        take: Path | None = None,
        *,
        mirror: bool = False,
        voice: Voice | None = None,
        record: Path | None = None,
        waiting: PreloadedBody | None = None,
    ) -> None:
        waiting = waiting or PreloadedBody()
        if voice is not None and voice.path == "-":
            pump(waiting.voice)
        else:
            waiting.voice.close()
        self.mailbox = Mailbox.create(len(parameters.names))
        self._insights = Mailbox.create(panel_state_size(parameters))
        self.insight = PanelState(self._insights, [layer.name for layer in by_priority(stage.layers)], parameters)
        self.finished = False
        self.report: dict[str, object] = {}
        orders = BodyOrders(
            str(stage.path),
            self.mailbox.path,
            str(take) if take else None,
            mirror,
            voice,
            str(record) if record else None,
            self._insights.path,
        )
        self._pipe, self._process = waiting.pipe, waiting.process
        waiting.send(orders)

    def wait_ready(self) -> Ready:
        """Wait until the servos stand.

        Raises
        ------
        ControllerError
            with the body's own message when they do not come up.
        """
        message = self._receive(_START_TIMEOUT_S)
        if not isinstance(message, Ready):
            raise ControllerError(f"the body said {message!r} before it was ready")
        return message

    def begin(self) -> None:
        """Let commands in: open the links, or start the take."""
        self.tell(Begin())

    def alive(self) -> bool:
        """Whether the body still runs and has something to play; takes in what it said.

        Raises
        ------
        ControllerError
            when the body gave up.
        """
        while self._pipe.poll():
            self._take_in(self._receive(0.0))
        return not self.finished

    def tell(self, request: Begin | Hold | Show | Neutral) -> None:
        """Pass on what main or its panel wants."""
        with suppress(OSError):  # a body that is gone is told by alive()
            self._pipe.send(request)

    @property
    def pid(self) -> int:
        """The body's process; SIGTERM and SIGHUP let it stop its servos by itself."""
        return self._process.pid or 0

    def kill(self) -> None:
        """Send the body SIGKILL: the servos are left to their bus watchdog."""
        self._process.kill()

    def stop(self) -> None:
        """Ask the body to stop, wait for its servos to be safe, and keep its report."""
        if not self._process.is_alive() and not self._pipe.poll():
            return
        try:
            self._pipe.send(Stop())
            while not self.report:
                self._take_in(self._receive(_STOP_TIMEOUT_S))
        except BrokenPipeError:
            pass
        finally:
            self._end_process()

    def _take_in(self, message: object) -> None:
        if isinstance(message, Report):
            self.report = message.content
        elif isinstance(message, Finished):
            self.finished = True

    def _receive(self, timeout_s: float) -> object:
        try:
            message = self._pipe.recv() if self._pipe.poll(timeout_s) else None
        except (EOFError, OSError):
            self._process.join(1.0)
            message = Failed(f"the body process ended by itself (exit code {self._process.exitcode})")
        if message is None:
            raise ControllerError(f"the body did not answer within {timeout_s:g} s")
        if isinstance(message, Failed):
            self.report = self.report or {"failed": message.message}
            raise ControllerError(message.message, hint=message.hint)
        return message

    def _end_process(self) -> None:
        self._process.join(_STOP_TIMEOUT_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(_TERMINATE_TIMEOUT_S)
        if self._process.is_alive():  # its servos are left to their bus watchdog, which is better than a hang
            self._process.kill()
            self._process.join()

    def __enter__(self) -> BodyProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self.stop()
            else:
                self._stop_quietly()
        finally:
            self._pipe.close()
            self.mailbox.close()
            self._insights.close()

    def _stop_quietly(self) -> None:
        """Stop while another error is on its way out; that one is the one to tell."""
        try:
            self.stop()
        except ControllerError:
            self._end_process()


@dataclass
class Deadline:
    """True until ``seconds`` have passed since the first question; None never ends."""

    seconds: float | None
    _end: float | None = None

    def __call__(self) -> bool:
        if self.seconds is None:
            return True
        if self._end is None:
            self._end = time.monotonic() + self.seconds
        return time.monotonic() < self._end
