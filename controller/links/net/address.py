"""Parses addresses of far ends as a user writes them."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass

from controller.formats.format import Format

_DEVICE = re.compile(r"/|serial:|COM\d|socket://", re.IGNORECASE)
_MIDI = re.compile(r"midi:(.+)", re.IGNORECASE)
_SCHEME = re.compile(r"(udp|tcp):(?!//)(.*)", re.IGNORECASE | re.DOTALL)
LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class Address:
    """The address of a far end.

    transport : ``udp``, ``tcp``, ``serial``, ``midi`` or ``lines`` (standard input or output).
    host, port : for UDP and TCP. device : path of a serial port, or name of a MIDI port.
    """

    transport: str
    host: str = ""
    port: int = 0
    device: str = ""

    def __str__(self) -> str:
        if self.transport == "lines":
            return "-"
        if self.transport == "midi":
            return f"midi:{self.device}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return self.device if self.transport == "serial" else f"{self.transport}:{host}:{self.port}"

    @property
    def is_local(self) -> bool:
        """Whether only programs on this machine can reach it."""
        if self.transport not in ("udp", "tcp") or self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


def has_token(form: Format, address: Address) -> bool:
    """Whether messages to an address can have a token: TCP streams at their beginning, datagrams if the format does."""
    return address.transport == "tcp" or (address.transport == "udp" and form.takes_token)


def is_called(form: Format, address: Address) -> bool:
    """Whether one can connect to a program at an address: by TCP, or by UDP if the format has a greeting."""
    return address.transport == "tcp" or (address.transport == "udp" and form.greeting != b"")


def parse_address(text: str, form: Format) -> Address:
    """Parse ``[udp:|tcp:]HOST:PORT``, ``midi:NAME``, a serial port, or ``-`` for a standard stream.

    form : the format, which gives the default transport and port.

    Raises ValueError: the text is not an address, or the format does not have this transport.
    """
    text = text.strip()
    if text == "-":
        found = Address("lines")
    elif (midi := _MIDI.fullmatch(text)) is not None:
        found = Address("midi", device=midi[1])
    elif _DEVICE.match(text):
        found = Address("serial", device=text.removeprefix("serial:"))
    else:
        scheme = _SCHEME.fullmatch(text)
        transport, rest = (scheme[1].lower(), scheme[2]) if scheme else (_network(form), text)
        host, port = _host_and_port(rest, form.port, text)
        found = Address(transport, host, port)
    if found.transport not in form.transports:
        raise ValueError(f"{form.kind} does not travel by {found.transport}; it does by {', '.join(form.transports)}")
    return found


def _network(form: Format) -> str:
    """Return the default transport of a host and port."""
    return next((each for each in form.transports if each in ("udp", "tcp")), "udp")


def _is_host(text: str) -> bool:
    """Whether a host can be looked up: IDNA allows labels of 1 to 63 characters (RFC 3490)."""
    try:
        return bool(text.encode("idna"))
    except UnicodeError:
        return False


def _host_and_port(rest: str, usual: int, text: str) -> tuple[str, int]:
    host, colon, port = rest.rpartition(":")
    if not colon:
        host, port = rest, str(usual)
    host = host.removeprefix("[").removesuffix("]") or LOOPBACK
    whole = port.isascii() and port.isdigit() and len(port) <= 5 and 0 < int(port) < 65_536
    if not whole or re.search(r"[\s/\\]", host) or not _is_host(host):
        raise ValueError(f'{text!r} is not HOST:PORT, as "{LOOPBACK}:{usual or 9400}"')
    return host, int(port)
