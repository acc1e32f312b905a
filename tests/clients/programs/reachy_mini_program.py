"""The controller of Reachy Mini's nine motors."""

import sys
import time

from reachy_mini_motor_controller import ReachyMiniMotorController

head = ReachyMiniMotorController(sys.argv[1])
here = head.read_all_positions()
assert len(here) == 9
head.set_all_goal_positions(here)
head.enable_torque()
assert head.is_torque_enabled()
wanted = [angle + 0.05 for angle in here]
head.set_all_goal_positions(wanted)
end = time.monotonic() + 20
while max(abs(a - b) for a, b in zip(head.read_all_positions(), wanted, strict=True)) > 0.01:
    assert time.monotonic() < end
head.disable_torque()
