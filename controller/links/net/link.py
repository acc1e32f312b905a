"""Opens a link in one of the formats, which receives faces, sends them, or both."""

from __future__ import annotations

import logging
from pathlib import Path

from controller.base.errors import LinkError
from controller.base.parameters import did_you_mean
from controller.links.access import token_for
from controller.links.kind import LinkContext
from controller.links.net.address import has_token
from controller.links.net.incoming import Incoming
from controller.links.net.neutral import state_file
from controller.links.net.opening import greeting_of, open_receiver
from controller.links.net.outgoing import Outgoing
from controller.links.net.receivers import Gate, SerialReceiver
from controller.links.net.senders import Sender, SerialAnswerer, open_sender
from controller.links.net.settings import NetSettings

log = logging.getLogger(__name__)


class NetLink:
    """An open link."""

    def __init__(self, address: str, incoming: Incoming | None, outgoing: Outgoing | None) -> None:
        self._address, self._parts = address, [part for part in (incoming, outgoing) if part is not None]

    def report(self) -> dict[str, object]:
        """Return the counts of both directions."""
        found: dict[str, object] = {"port": self._address}
        for part in self._parts:
            found |= part.report()
        return found


def open_net(settings: NetSettings, context: LinkContext) -> NetLink:
    """Open the directions that the settings name.

    Raises LinkError: an address cannot be used, the layer is unknown, or the saved calibration cannot be read.
    PortError: a serial port cannot be opened.
    """
    name = f"{settings.form.kind} {settings.address}"
    incoming = _open_incoming(settings, context, name) if settings.incoming is not None else None
    outgoing = _open_outgoing(settings, context, name, incoming) if settings.outgoing is not None else None
    for part in (incoming, outgoing):
        if part is not None:
            part.start()
    return NetLink(settings.address, incoming, outgoing)


def _open_incoming(settings: NetSettings, context: LinkContext, name: str) -> Incoming:
    layers = context.sink.layer_names()
    if settings.layer not in layers:
        raise LinkError(
            f"{name}: unknown layer {settings.layer!r}{did_you_mean(settings.layer, layers)}",
            hint=f"add it to the stage: [layers.{settings.layer}] and priority = 55; there are {', '.join(layers)}",
        )
    address = settings.incoming
    assert address is not None
    token = token_for(name, address.host, settings.token) if settings.needs_token else None
    if not address.is_local and settings.connect is None and token is None:
        log.warning("%s: every machine that reaches %s can move this face and its servos, without a password%s",
                    name, address, "" if settings.source else '; source = "HOST" takes one sender only')  # fmt: skip
    gate = None if token is None else Gate(token, settings.form.delimiter)
    greeting = greeting_of(settings.form, settings.token)
    receiver = open_receiver(
        address, connect=settings.connect is not None, baud=settings.baud, gate=gate, greeting=greeting
    )
    learns = settings.calibrate != "off" or settings.ranges
    path = _calibration_file(settings, getattr(context.sink, "name", "")) if learns else None
    try:
        incoming = Incoming(settings, receiver, context.sink, name, path, gate)
    except BaseException:
        receiver.close()
        raise
    context.closers.callback(incoming.stop)
    return incoming


def _calibration_file(settings: NetSettings, head: str) -> Path:
    """Return the file for the calibration of a source.

    It is named after the source if the link accepts only one, else after the head, if it has a name, and the layer.
    """
    suffix = settings.source or "-".join(filter(None, (head, settings.layer)))
    return state_file(f"{settings.form.kind}-{suffix}")


def _open_outgoing(
    settings: NetSettings, context: LinkContext, name: str, incoming: Incoming | None = None
) -> Outgoing:
    assert settings.outgoing is not None
    receiver = None if incoming is None else incoming.receiver
    sender: Sender
    if isinstance(receiver, SerialReceiver) and settings.is_one_port:
        sender = SerialAnswerer(receiver.port, settings.form.delimiter)
    else:
        token = settings.token if has_token(settings.form, settings.outgoing) else None
        sender = open_sender(settings.outgoing, settings.form.delimiter, settings.baud, token)
    outgoing = Outgoing(settings, sender, context.sink, name)
    context.closers.callback(outgoing.stop)
    return outgoing
