"""pypot, the library of Poppy: Protocol 1.0.

It flushes the port before each packet, which on a busy machine discards what the far end has not read yet: so this
program pauses after each write.
"""

import sys
import time

from pypot.dynamixel.io import DxlIO

with DxlIO(sys.argv[1], baudrate=1_000_000, timeout=1.0) as io:
    ids = [1, 2, 3]
    assert io.scan([1, 2, 3, 4]) == ids
    here = dict(zip(ids, io.get_present_position(ids), strict=True))
    io.set_moving_speed(dict.fromkeys(ids, 60))
    time.sleep(0.2)
    io.set_goal_position(here)
    time.sleep(0.2)
    io.enable_torque(ids)
    time.sleep(0.2)
    io.set_goal_position({servo: angle + 5 for servo, angle in here.items()})
    time.sleep(0.2)
    end = time.monotonic() + 20
    while any(abs(now - here[servo] - 5) > 1 for servo, now in zip(ids, io.get_present_position(ids), strict=True)):
        assert time.monotonic() < end
    io.disable_torque(ids)
    time.sleep(0.2)
    assert io.get_model(ids) == ("AX-12",) * 3
