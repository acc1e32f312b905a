"""drivers.base.errors: one tree, and one error for several servos."""

from __future__ import annotations

import pytest

from drivers.base import errors
from drivers.base.errors import CorruptReply, DriverError, NoReply, merge_errors

TREE = {
    "PluginError": "DriverError", "PortError": "DriverError", "BusError": "DriverError",
    "PortMissing": "PortError", "PortBusy": "PortError", "PortPermission": "PortError", "PortLost": "PortError",
    "NoReply": "BusError", "CorruptReply": "BusError", "WrongModel": "BusError", "ServoRefused": "BusError",
    "ServoFault": "BusError",
}  # fmt: skip


def test_every_error_has_its_place_in_the_tree() -> None:
    found = {
        name: error.__bases__[0].__name__
        for name, error in vars(errors).items()
        if isinstance(error, type) and issubclass(error, DriverError) and error is not DriverError
    }
    assert found == TREE


def test_an_error_carries_what_is_needed_next() -> None:
    error = NoReply("no answer", hint="check the cable", port="/dev/x", servo_ids=(1, 2))
    assert (str(error), error.hint, error.port, error.servo_ids) == ("no answer", "check the cable", "/dev/x", (1, 2))
    bare = DriverError("it failed")
    assert (bare.hint, bare.port, bare.servo_ids) == ("", None, ())


def test_one_error_of_one_servo_stays_as_it_is() -> None:
    one = NoReply("a", servo_ids=(3,))
    assert merge_errors({3: one}) is one


def test_errors_of_several_servos_are_one_of_the_first_kind() -> None:
    first = CorruptReply("servo 9 sent noise", hint="look", port="/dev/x", servo_ids=(9,))
    both = merge_errors({9: first, 3: NoReply("b", hint="other"), 12: NoReply("c")})
    assert type(both) is CorruptReply
    assert str(both) == "servo 9 sent noise; the same or worse for 3 servos: ids 3, 9, 12"
    assert (both.hint, both.port, both.servo_ids) == ("look", "/dev/x", (3, 9, 12))
    with pytest.raises(CorruptReply):
        raise both
