"""The error tree of the controller room."""

from __future__ import annotations

import pytest

from controller.base.errors import OMOTE_ERRORS, ConfigError, ControllerError, LinkError, ParameterError, TakeError
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
