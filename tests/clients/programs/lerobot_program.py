"""LeRobot's bus of Feetech motors: it checks models and firmware, then reads and writes all at once."""

import sys
import time
from unittest.mock import MagicMock

# Helpers that its motors import need these, which are gigabytes; nothing of them is used here.
for name in ("torch", "accelerate", "datasets", "datasets.utils", "datasets.utils.logging"):
    sys.modules[name] = MagicMock()

from lerobot.motors import Motor, MotorNormMode  # noqa: E402
from lerobot.motors.feetech import FeetechMotorsBus  # noqa: E402

names = ["pan", "lift", "elbow", "flex", "roll", "gripper"]
bus = FeetechMotorsBus(
    sys.argv[1], {name: Motor(k + 1, "sts3215", MotorNormMode.RANGE_M100_100) for k, name in enumerate(names)}
)
bus.connect()
here = bus.sync_read("Present_Position", normalize=False)
assert here == dict.fromkeys(names, 2048), here
bus.sync_write("Goal_Position", here, normalize=False)
bus.enable_torque()
bus.sync_write("Goal_Position", dict.fromkeys(names, 2070), normalize=False)
end = time.monotonic() + 20
while bus.sync_read("Present_Position", normalize=False) != dict.fromkeys(names, 2070):
    assert time.monotonic() < end
bus.disable_torque()
bus.disconnect()
