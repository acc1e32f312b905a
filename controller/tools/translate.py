"""Forwards faces from one format to another, without a stage, a picture or servos."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from controller.base.errors import LinkError
from controller.base.parameters import Parameters
from controller.formats.format import FORMATS, Format
from controller.formats.frame import Frame
from controller.links.net.address import LOOPBACK, Address, has_token, is_called, parse_address
from controller.links.net.decoding import Decoding
from controller.links.net.meter import Meter
from controller.links.net.opening import greeting_of, open_receiver
from controller.links.net.receivers import Gate, InputReceiver
from controller.links.net.senders import Sender, open_sender
from controller.takes.reader import load_take, suffixes
from drivers.base.errors import PluginError

_RECEIVE_TIMEOUT_S = 0.02
_MAX_VALUE = 100.0  # 1 is a parameter's whole movement; formats cannot encode any number
_HINT = "write it as KIND:ADDRESS, for example livelink:127.0.0.1:11111; omote plugins lists the kinds"


@dataclass(frozen=True)
class Options:
    """How to translate.

    mirror : swap left and right. connect : connect to the input's address instead of listening. baud : of serial ports.
    open_to_network : listen at an address that other machines reach. token : shared password with which TCP streams,
        and datagrams of omote's own formats, begin, both of the input and of the output.
    seconds : time limit; None runs until the input ends. stop : ends the translation when it is set.
    """

    mirror: bool = False
    connect: bool = False
    baud: int = 115_200
    open_to_network: bool = False
    token: str | None = None
    seconds: float | None = None
    stop: threading.Event = field(default_factory=threading.Event)


@dataclass
class Counts:
    """Counts of a translation.

    frames : received. sent, dropped : messages that were sent, and those dropped because the queue was full or nobody
    was connected. refused : parts of the input that were refused, by reason. meter : rate of the frames.
    """

    frames: int = 0
    sent: int = 0
    dropped: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    meter: Meter = field(default_factory=Meter)

    def __str__(self) -> str:
        refused = ", ".join(f"{count} {reason}" for reason, count in self.refused.items()) or "nothing"
        figures = self.meter.report(time.monotonic())
        return (
            f"{self.frames} frames received at {figures['rate_hz']}/s; {self.sent} messages sent, {self.dropped} "
            f"dropped (full or no receiver); refused: {refused}"
        )


class Input(Protocol):
    """A source of frames."""

    def frames(self, counts: Counts) -> Iterator[Frame | None]:
        """Yield frames until the input ends, and None whenever none came for a while; updates ``counts.refused``."""


def translate(source: str, target: str, parameters: Parameters, options: Options = Options(),
              ready: Callable[[str], None] = lambda text: None) -> Counts:  # fmt: skip
    """Translate until the input ends, the time is over, or Ctrl-C.

    source : ``kind:address``, or the path of a take. target : ``kind:address``. ready : called with a message once both
    are open.

    Raises LinkError, PortError, TakeError, PluginError: source or target is wrong or cannot be opened.
    """
    counts = Counts()
    form, address = parse_end(target)
    with ExitStack() as closers:
        frames = _open_input(source, parameters, options, closers)
        token = options.token if has_token(form, address) else None
        sender = open_sender(address, form.delimiter, options.baud, token)
        closers.callback(sender.close)
        ready(f"translating {source} to {form.kind} at {address}{_network_notice(source, options)}")
        with suppress(KeyboardInterrupt):
            _forward(frames, form, sender, parameters, options, counts)
    return counts


def parse_end(text: str) -> tuple[Format, Address]:
    """Parse ``kind:address`` to a format and an address.

    Raises LinkError: the text is not of this form, or there is no such format.
    """
    kind, _, rest = text.partition(":")
    try:
        form = FORMATS.get(kind)
        return form, parse_address(rest or LOOPBACK, form)
    except ValueError as error:
        raise LinkError(f"{text}: {error}", hint=_HINT) from error
    except PluginError as error:
        raise LinkError(f"{text}: {error}", hint=_HINT) from error


def _network_notice(source: str, options: Options) -> str:
    """Return a notice that other machines can send to a live input; empty if they cannot reach it."""
    if not options.open_to_network or _is_take(source):
        return ""
    form, address = parse_end(source)
    if address.is_local:
        return ""
    who = "with the token" if has_token(form, address) and options.token else "without a password"
    return f"; every machine that reaches {address} can send faces there, {who}"


def _is_take(source: str) -> bool:
    """Whether an input is the path of a take."""
    return Path(source).suffix.lower() in suffixes() and source.partition(":")[0] not in FORMATS.kinds()


def _open_input(source: str, parameters: Parameters, options: Options, closers: ExitStack) -> Input:
    if _is_take(source):
        return TakeInput(Path(source), parameters)
    form, address = parse_end(source)
    if not (options.connect or address.is_local or options.open_to_network):
        raise LinkError(
            f"{source}: every machine that reaches this one could send faces there",
            hint="add --open-to-network if you want that",
        )
    if not address.is_local and form.takes_token and options.token is None:
        raise LinkError(f"{source}: other machines need a token there", hint="choose one and add --token TOKEN")
    if options.connect and not is_called(form, address):
        raise LinkError(f"{source}: --connect needs a TCP address", hint=f"write it as {form.kind}:tcp:HOST:PORT")
    return LiveInput(form, address, parameters, options, closers)


class LiveInput:
    """Frames that another program sends."""

    def __init__(
        self, form: Format, address: Address, parameters: Parameters, options: Options, closers: ExitStack
    ) -> None:
        gate = Gate(options.token, form.delimiter) if options.token is not None and has_token(form, address) else None
        self._receiver = open_receiver(address, connect=options.connect, baud=options.baud, gate=gate,
                                       greeting=greeting_of(form, options.token))  # fmt: skip
        closers.callback(self._receiver.close)
        self._decoding = Decoding(form, parameters, streams=address.transport != "udp")

    def frames(self, counts: Counts) -> Iterator[Frame | None]:
        while True:
            arrived = self._decoding.feed(self._receiver.receive(_RECEIVE_TIMEOUT_S))
            counts.refused = dict(self._decoding.refused)
            yield from (each.frame for each in arrived)
            if isinstance(self._receiver, InputReceiver) and self._receiver.ended:
                return
            yield None


class TakeInput:
    """The frames of a take, at its own rate."""

    def __init__(self, path: Path, parameters: Parameters) -> None:
        self._take = load_take(path, parameters)

    def frames(self, counts: Counts) -> Iterator[Frame | None]:
        take, start_s = self._take, time.monotonic()
        for time_s, values in zip(take.times_s, take.values, strict=True):
            while (left_s := start_s + time_s - time.monotonic()) > 0.0:
                time.sleep(min(left_s, _RECEIVE_TIMEOUT_S))
                yield None
            yield Frame(values, take.mask, float(time_s))


def _forward(
    source: Input, form: Format, sender: Sender, parameters: Parameters, options: Options, counts: Counts
) -> None:
    encoder, end_s = form.encoder(parameters), time.monotonic() + (options.seconds or float("inf"))
    prepare = _make_preparation(parameters, options.mirror)
    for frame in source.frames(counts):
        if frame is not None:
            counts.frames += 1
            counts.meter.note(time.monotonic(), frame.sequence)
            for message in encoder.encode(prepare(frame)):
                if sender.send(message):
                    counts.sent += 1
                else:
                    counts.dropped += 1
        if time.monotonic() >= end_s or options.stop.is_set():
            return


def _make_preparation(parameters: Parameters, mirror: bool) -> Callable[[Frame], Frame]:
    """Return a function that clips the values of a frame and, if ``mirror``, swaps left and right."""
    order = parameters.mirror() if mirror else np.arange(len(parameters))
    signs = [-1.0 if mirror and name.endswith(("Yaw", "Roll")) else 1.0 for name in parameters.names]

    def prepare(frame: Frame) -> Frame:
        values = np.clip(frame.values[order] * signs, -_MAX_VALUE, _MAX_VALUE)
        return replace(frame, values=values, mask=frame.mask[order])

    return prepare
