"""Austin Bowen's driver of Pololu's Maestro: limits of speed and acceleration, several targets at once, positions."""

import sys
import time

from maestro import Maestro

CHANNELS = (0, 1, 2)

with Maestro.connect("mini12", sys.argv[1], timeout=5) as board:
    for channel in CHANNELS:
        board.set_speed(channel, 1000)  # us a second
        board.set_acceleration(channel, 40)
    board.set_targets(dict.fromkeys(CHANNELS, 1500))
    board.wait_until_done_moving()
    board.set_targets({channel: 1600 + 50 * channel for channel in CHANNELS})
    assert board.any_are_moving()
    end = time.monotonic() + 20
    while board.any_are_moving():
        assert time.monotonic() < end
    assert board.get_positions()[:3] == [1600, 1650, 1700], board.get_positions()
    board.set_target(0, 1550.25)
    board.wait_until_done_moving()
    assert board.get_position(0) == 1550.25
    assert not board.get_errors()
