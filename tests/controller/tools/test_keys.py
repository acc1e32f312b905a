"""controller.tools.keys on a real pseudo-terminal."""

from __future__ import annotations

import os
import sys

import pytest

from controller.base.errors import ControllerError
from controller.tools.keys import keyboard, split_keys

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")


def test_keys_arrive_one_by_one_and_the_terminal_is_left_as_it_was() -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    with keyboard(slave) as read_keys:
        assert read_keys(0.0) == []
        os.write(master, b"n\x1b[A\x1b[D[q")
        assert read_keys(0.2) == ["n", "up", "left", "[", "q"]
    assert termios.tcgetattr(slave) == before
    os.close(master)
    os.close(slave)


def test_unknown_sequences_are_left_out() -> None:
    assert split_keys("\x1b[Ha") == ["a"]


def test_something_that_is_no_terminal_is_refused() -> None:
    reading, writing = os.pipe()
    with pytest.raises(ControllerError, match="terminal"):
        keyboard(reading).__enter__()
    os.close(reading)
    os.close(writing)
