"""The main process's side of the control process (body): starts it, sends requests, receives reports, stops it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache

from controller.base.errors import ConfigError, ControllerError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import Parameters
from controller.body import messages
from controller.body.panel_state import PanelState
from controller.body.preload import PreloadedBody
from controller.body.sources import pump
from controller.layers.mixer import by_priority
from controller.stage.stage import Stage, heads_of

_START_TIMEOUT_S = 60.0
_STOP_TIMEOUT_S = 30.0
_TERMINATE_TIMEOUT_S = 5.0


class BodyProcess:
    """The control process (body) of a run; a context manager that always stops it.

    preloaded : a process that waits for orders. Default: start one.

    Attributes
    ----------
    mailboxes, panel_states : of each head, in the order of the stage. mailbox, panel_state : of the first one.
    details : the newest answer to :class:`controller.body.messages.AskDetails`. ready : whether the servos are started.
    finished : whether all sources ended.
    report : the final measurements, empty before the end.
    """

    def __init__(
        self,
        stage: Stage,
        parameters: Parameters,
        options: messages.RunOptions = messages.RunOptions(),
        *,
        preloaded: PreloadedBody | None = None,
    ) -> None:
        preloaded = preloaded or PreloadedBody()
        options = self._forward_standard_input(stage, options, preloaded)
        stages = heads_of(stage)
        self.mailboxes = [Mailbox.create(len(parameters.names)) for _ in stages]
        self._panel_mailboxes = [Mailbox.create(PanelState.size(parameters)) for _ in stages]
        self.panel_states = [
            PanelState(mailbox, [layer.name for layer in by_priority(each.layers)], parameters)
            for mailbox, each in zip(self._panel_mailboxes, stages, strict=True)
        ]
        self.mailbox, self.panel_state = self.mailboxes[0], self.panel_states[0]
        self.ready = self.finished = False
        self.details: messages.Details | None = None
        self.report: dict[str, object] = {}
        self._pipe, self._process = preloaded.pipe, preloaded.process
        pairs = zip(self.mailboxes, self._panel_mailboxes, strict=True)
        boxes = [mailbox for pair in pairs for mailbox in pair]
        preloaded.send(messages.BodyOrders(str(stage.path), options), *boxes)
        self._in_time = deadline(_START_TIMEOUT_S)
        self._in_time()  # the time runs from now on

    @staticmethod
    def _forward_standard_input(
        stage: Stage, options: messages.RunOptions, preloaded: PreloadedBody
    ) -> messages.RunOptions:
        """Forward standard input to the body if a voice or a link reads it; return the options with that choice."""
        voice = options.voice is not None and options.voice.path == "-"
        links = (
            0
            if options.take is not None
            else sum(link.takes_input for each in heads_of(stage) for link in each.settings.links)
        )
        link = links > 0
        if voice + links > 1:
            hint = "give the voice as a file or a pipe, or a link another address"
            raise ConfigError(f"{stage.path}: only one voice or link can have standard input", hint=hint)
        if voice or link:
            pump(preloaded.voice, raw=link)
        else:
            preloaded.voice.close()
        return replace(options, standard_input=link)

    def wait_ready(self) -> messages.Ready:
        """Wait until the servos are started. Raises ControllerError: they cannot be started, or there is no answer."""
        message = self._receive(_START_TIMEOUT_S)
        if not isinstance(message, messages.Ready):
            raise ControllerError(f"the body sent {message!r} before it was ready")
        self._handle(message)
        return message

    def begin(self) -> None:
        """Tell the body to open the links, or to start the take, as soon as it is ready."""
        self.send(messages.Begin())

    def alive(self) -> bool:
        """Receive the body's messages; return whether the run is to continue.

        Raises ControllerError if it failed, or is not ready long after it got its orders.
        """
        while self._pipe.poll():
            self._handle(self._receive(0.0))
        if not self.ready and not self._in_time():
            raise _no_answer(_START_TIMEOUT_S)
        return not self.finished

    def send(self, request: messages.Begin | messages.PanelRequest | messages.ToHead) -> None:
        """Send a request of the main process or its panel."""
        with suppress(OSError):  # alive() reports a body that has ended
            self._pipe.send(request)

    def stop(self) -> None:
        """Tell the body to stop, wait until its servos are safe, and keep its report."""
        if not self._process.is_alive() and not self._pipe.poll():
            return
        try:
            with suppress(OSError):  # a body that has ended by a signal has left its report in the pipe
                self._pipe.send(messages.Stop())
            while not self.report:
                self._handle(self._receive(_STOP_TIMEOUT_S))
        finally:
            self._end_process()

    def _handle(self, message: object) -> None:
        if isinstance(message, messages.Ready):
            self.ready = True
        elif isinstance(message, messages.Report):
            self.report = message.content
        elif isinstance(message, messages.Details):
            self.details = message
        elif isinstance(message, messages.Finished):
            self.finished = True

    def _receive(self, timeout_s: float) -> object:
        try:
            message = self._pipe.recv() if self._pipe.poll(timeout_s) else None
        except (EOFError, OSError):
            self._process.join(1.0)
            message = messages.Failed(f"the body process ended unexpectedly (exit code {self._process.exitcode})")
        if message is None:
            raise _no_answer(timeout_s)
        if isinstance(message, messages.Failed):
            self.report = self.report or {**message.measured, "failed": message.message}
            raise ControllerError(message.message, hint=message.hint)
        return message

    def _end_process(self) -> None:
        self._process.join(_STOP_TIMEOUT_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(_TERMINATE_TIMEOUT_S)
        if self._process.is_alive():  # the servos' watchdog stops them, which is better than waiting forever
            self._process.kill()
            self._process.join()

    def __enter__(self) -> BodyProcess:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            if error is None:
                self.stop()
                return
            try:
                self.stop()
            except ControllerError:  # the error that is already being raised is reported
                self._end_process()
        finally:
            self._pipe.close()
            for mailbox in (*self.mailboxes, *self._panel_mailboxes):
                mailbox.close()


def _no_answer(timeout_s: float) -> ControllerError:
    return ControllerError(f"the body did not answer within {timeout_s:g} s")


def deadline(seconds: float | None) -> Callable[[], bool]:
    """Return a function that is true until ``seconds`` have passed since its first call, or always if None."""
    first_s = cache(time.monotonic)
    return lambda: seconds is None or time.monotonic() - first_s() < seconds
