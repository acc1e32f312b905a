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
"""Version of the interface of formats: this module and :mod:`controller.formats.frame`."""

TRANSPORTS = ("udp", "tcp", "serial", "lines", "midi")
"""How messages travel: datagrams, TCP streams, serial ports, lines of text on standard input and output, MIDI ports."""

_SUFFIX = "_format"


def nothing(parameters: Parameters) -> Flags:
    """Return a mask (P,) of no parameter."""
    return np.zeros(len(parameters), dtype=bool)


def everything(parameters: Parameters) -> Flags:
    """Return a mask (P,) of every parameter, including user-defined ones; for messages that name parameters."""
    return np.ones(len(parameters), dtype=bool)


def base_only(parameters: Parameters) -> Flags:
    """Return a mask (P,) of the base vocabulary; for messages that number parameters or rename them."""
    return np.arange(len(parameters)) < parameters.base


@dataclass(frozen=True, kw_only=True)
class Format:
    """A message format.

    api : version of the registry that the format is made for; see :data:`API`.
    kind : its name in stage files and commands. title : its name for people.
    transports : how its messages travel, of :data:`TRANSPORTS`; the first is the default.
    port : UDP or TCP port that programs with this format use; 0 if there is none.
    decoder, encoder : make a decoder or encoder for given parameters, for one source or receiver.
    carries : returns which parameters its messages can hold, (P,) bool.
    about : returns which further ones they hold only approximately, such as one number for both a smile and a frown.
    quantum : greatest rounding error of a value, in units of a parameter, in addition to the 1e-4 of every format.
    delimiter : ends a message of a stream; empty if the format has datagrams only.
    pieces : whether its decoder takes a stream in pieces of any length, so that it needs no delimiter.
    most : length of the longest message, in bytes.
    timeout_s : a source that has been silent for this long counts as lost; infinity if messages are sent on changes
        only.
    takes_token : whether a TCP stream from another machine, and each datagram from one, must begin with a token; False
        if the usual senders know nothing of tokens.
    greeting : sent to a program that omote connects to for faces, before reading; a whole message with its delimiter.
    measured : whether its messages can hold, beside the face, the face that the servos show.
    note : one sentence, for people, on what the format cannot carry.
    install : argument of ``pip install`` if a package is missing.
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


def _built_in() -> dict[str, str]:
    """Return the modules of the built-in formats by kind."""
    found = modules_in("controller.formats.kinds").items()
    return {stem.removesuffix(_SUFFIX).replace("_", "-"): module for stem, module in found if stem.endswith(_SUFFIX)}


def _check(found: Format) -> None:
    """Raise ValueError for unknown transports, and for a stream whose messages have no delimiter."""
    unknown = [each for each in found.transports if each not in TRANSPORTS]
    if unknown or not found.transports:
        raise ValueError(f"transports must be of {', '.join(TRANSPORTS)}, not {', '.join(unknown) or 'none'}")
    if not (found.delimiter or found.pieces) and set(found.transports) != {"udp"}:
        raise ValueError("a stream needs a delimiter that ends each message")


FORMATS: Registry[Format] = Registry(Format, "format", "omote.formats", API, _built_in, "FORMAT", check=_check)
