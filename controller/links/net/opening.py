"""Opens the receiver of an address."""

from __future__ import annotations

from controller.formats.format import Format
from controller.links.net.address import Address
from controller.links.net.receivers import (
    Gate,
    InputReceiver,
    Receiver,
    SerialReceiver,
    TcpCaller,
    TcpListener,
    UdpReceiver,
    auth_message,
)
from controller.links.net.udp_caller import UdpCaller


def greeting_of(form: Format, token: str | None) -> bytes:
    """Return what is sent first to a program that omote connects to: the token, if any, and the format's greeting."""
    return (b"" if token is None else auth_message(token) + form.delimiter) + form.greeting


def open_receiver(
    address: Address, *, connect: bool = False, baud: int = 115_200, gate: Gate | None = None, greeting: bytes = b""
) -> Receiver:
    """Open and return the receiver of an address.

    connect : connect to the address, or send it UDP requests, instead of waiting for connections or datagrams.
    baud : rate of a serial port. gate : checks the token with which incoming streams and datagrams must begin; None: no
    token is needed. greeting : sent to a program that is connected to.

    Raises LinkError: the address is in use or not one of this machine. PortError: the serial port cannot be opened.
    """
    if address.transport == "udp" and connect:
        return UdpCaller(address, greeting)
    if address.transport == "udp":
        return UdpReceiver(address, gate)
    if address.transport == "tcp":
        return TcpCaller(address, greeting) if connect else TcpListener(address, gate)
    if address.transport == "midi":
        from controller.links.net.midi import MidiReceiver  # imported lazily: few links need it

        return MidiReceiver(address.device)
    return SerialReceiver(address.device, baud) if address.transport == "serial" else InputReceiver()
