"""The error tree of the controller room."""

from __future__ import annotations

import errno

import pytest

from controller.base.errors import (
    OMOTE_ERRORS,
    ConfigError,
    ControllerError,
    LinkError,
    ParameterError,
    TakeError,
    exhausted,
)
from drivers.base.errors import DriverError, PortError
from surface.base.errors import SurfaceError


@pytest.mark.parametrize("kind", [ConfigError, ParameterError, LinkError, TakeError])
def test_every_error_is_a_controller_error_with_message_and_hint(kind: type[ControllerError]) -> None:
    error = kind("what failed", hint="what to type")
    assert isinstance(error, ControllerError)
    assert (str(error), error.hint) == ("what failed", "what to type")
    assert kind("what failed").hint == ""


def test_the_command_line_catches_the_errors_of_every_room_and_no_others() -> None:
    for error in (TakeError("a"), PortError("b"), DriverError("c"), SurfaceError("d")):
        with pytest.raises(OMOTE_ERRORS):
            raise error
    assert not issubclass(ValueError, OMOTE_ERRORS) and not issubclass(OSError, OMOTE_ERRORS)


@pytest.mark.parametrize(
    ("error", "text", "hint"),
    [
        (OSError(errno.EMFILE, "x", "/a"), "/a: Too many open files", "ulimit -n"),
        (OSError(errno.ENOSPC, "x"), "No space left on device", "df -h"),
        (MemoryError(), "Cannot allocate memory", "free -h"),
    ],
)
def test_what_is_used_up_is_named_with_what_to_do(error: BaseException, text: str, hint: str) -> None:
    found = exhausted(error)
    assert found is not None and str(found) == text and hint in found.hint
    assert exhausted(ValueError()) is None and exhausted(OSError(errno.ENOENT, "x")) is None
