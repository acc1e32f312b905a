"""Defines what a format is, and registers all formats.

A format is a module ``KIND_format`` in ``controller/formats/kinds`` that holds ``FORMAT``, or another package with an
entry point in the group ``omote.formats`` that names a :class:`Format`; see docs/extending.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controller.base.parameters import Flags, Parameters
from controller.formats.frame import Decoder, Encoder
from drivers.base.plugins import Registry, modules_in

API = 1
"""Version of what a format must keep: this module and :mod:`controller.formats.frame`."""

TRANSPORTS = ("udp", "tcp", "serial", "lines", "midi")
"""How messages travel: datagrams, TCP streams, serial ports, lines of text on standard input and output, MIDI ports."""

_SUFFIX = "_format"


def nothing(parameters: Parameters) -> Flags:
    """No parameter."""
    return np.zeros(len(parameters), dtype=bool)


def everything(parameters: Parameters) -> Flags:
    """Every parameter, somebody's own included: for messages with names."""
    return np.ones(len(parameters), dtype=bool)


def base_only(parameters: Parameters) -> Flags:
    """Those of the base vocabulary: for messages that number them, or have names of their own for them."""
    return np.arange(len(parameters)) < parameters.base


@dataclass(frozen=True, kw_only=True)
class Format:
    """One sort of messages.

    api : version of the registry it is made for; see :data:`API`.
    kind : its name in stages and commands. title : its name for people.
    transports : how its messages travel, of :data:`TRANSPORTS`; the first is used where nobody names one.
    port : UDP or TCP port that its programs use; 0 where there is none.
    decoder, encoder : make a decoder or encoder for some parameters; one serves one source or receiver.
    carries : says which parameters its messages can hold, (P,) bool.
    about : says which others they hold only in effect, as one number for a smile and a frown.
    quantum : how far a value may be rounded, in units of a parameter, besides the 1e-4 that every format keeps.
    delimiter : what ends a message of a stream; empty where the format has datagrams only.
    pieces : whether its decoder takes a stream in any pieces, so that it needs no delimiter.
    most : bytes of the longest message.
    timeout_s : a source that is silent for so long is usually lost; infinity where messages are sent on changes only.
    takes_token : whether a TCP stream that other machines may open, and each datagram that they may send, must begin
        with a token: not where programs that know nothing of tokens send them.
    greeting : what is sent to a program that is called for faces, before it is read; a whole message with its end.
    measured : whether its messages have room for what the servos show, beside the face.
    note : one sentence on what the format cannot carry, for people.
    install : what ``pip install`` takes where a package is missing.
    """

    api: int
    kind: str
    title: str
    transports: tuple[str, ...]
    decoder: Callable[[Parameters], Decoder]
    encoder: Callable[[Parameters], Encoder]
    carries: Callable[[Parameters], Flags]
    about: Callable[[Parameters], Flags] = nothing
    port: int = 0
    quantum: float = 0.0
    delimiter: bytes = b""
    pieces: bool = False
    most: int = 65_536
    timeout_s: float = 0.5
    takes_token: bool = False
    greeting: bytes = b""
    measured: bool = False
    note: str = ""
    install: str = ""


def _own() -> dict[str, str]:
    """Modules of the built-in formats by kind."""
    found = modules_in("controller.formats.kinds").items()
    return {stem.removesuffix(_SUFFIX).replace("_", "-"): module for stem, module in found if stem.endswith(_SUFFIX)}


def _check(found: Format) -> None:
    """ValueError for transports that are none, and for a stream whose messages have no end."""
    unknown = [each for each in found.transports if each not in TRANSPORTS]
    if unknown or not found.transports:
        raise ValueError(f"transports must be of {', '.join(TRANSPORTS)}, not {', '.join(unknown) or 'none'}")
    if not (found.delimiter or found.pieces) and set(found.transports) != {"udp"}:
        raise ValueError("a stream needs a delimiter that ends each message")


FORMATS: Registry[Format] = Registry(Format, "format", "omote.formats", API, _own, "FORMAT", check=_check)
