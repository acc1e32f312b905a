"""Defines the errors of the controller room, and the tuple of all errors that a command line has to catch."""

from __future__ import annotations

from drivers.base.errors import DriverError
from surface.base.errors import SurfaceError


class ControllerError(Exception):
    """Says what failed, where (file and key, port, line) and why; ``hint`` is the next thing to type, or empty."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class ConfigError(ControllerError):
    """A configuration file is wrong; the message lists every fault with its path in the file."""


class ParameterError(ControllerError):
    """An unknown parameter, or a value that is not a number."""


class LinkError(ControllerError):
    """A link to the outside cannot be opened or went away."""


class TakeError(ControllerError):
    """A recorded take cannot be read."""


OMOTE_ERRORS = (ControllerError, DriverError, SurfaceError)
"""Everything omote raises on purpose; the command line prints one message and exits with code 1."""
