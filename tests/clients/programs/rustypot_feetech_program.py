"""rustypot: the Rust library with Feetech servos."""

import sys
import time

import rustypot

head = rustypot.Sts3215PyController(sys.argv[1], 1_000_000, 0.5)
IDS = [1, 2, 3]
here = head.sync_read_present_position(IDS)
head.sync_write_goal_position(IDS, here)
head.sync_write_torque_enable(IDS, [True] * 3)
wanted = [angle + 0.05 for angle in here]
head.sync_write_goal_position(IDS, wanted)
end = time.monotonic() + 20
while max(abs(a - b) for a, b in zip(head.sync_read_present_position(IDS), wanted, strict=True)) > 0.01:
    assert time.monotonic() < end
head.sync_write_torque_enable(IDS, [False] * 3)
