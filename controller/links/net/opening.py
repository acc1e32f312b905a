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
    """What is sent to a program that is called: the token, where there is one, and what its format wants."""
    return (b"" if token is None else auth_message(token) + form.delimiter) + form.greeting


def open_receiver(
    address: Address, *, connect: bool = False, baud: int = 115_200, gate: Gate | None = None, greeting: bytes = b""
) -> Receiver:
    """What an address gives.

    connect : call the address instead of waiting for calls, or ask it by UDP. baud : rate of a serial port. gate : what
    streams of callers and datagrams must begin with; None for nothing. greeting : what a program hears that is called.

    Raises LinkError: the address is taken or not of this machine. PortError: the serial port cannot be opened.
    """
    if address.transport == "udp" and connect:
        return UdpCaller(address, greeting)
    if address.transport == "udp":
        return UdpReceiver(address, gate)
    if address.transport == "tcp":
        return TcpCaller(address, greeting) if connect else TcpListener(address, gate)
    if address.transport == "midi":
        from controller.links.net.midi import MidiReceiver  # few links need it

        return MidiReceiver(address.device)
    return SerialReceiver(address.device, baud) if address.transport == "serial" else InputReceiver()
