"""drivers.base.bus and drivers.open_bus: the specifications, the counters, the registry."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import drivers
from drivers.base.bus import BusReport, ServoSpec, frozen
from drivers.base.errors import DriverError

GOOD = {"id": 1, "name": "jaw", "model": "xl330-m288", "min_rad": -1.0, "max_rad": 1.0}
MOTION = {"max_speed_rad_s": 5.0, "max_accel_rad_s2": 50.0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"id": 253}, "id must be 0 to 252"),
        ({"id": -1}, "id must be 0 to 252"),
        ({"min_rad": 1.0}, "min_rad must be below max_rad"),
        ({"max_rad": float("nan")}, "max_rad must be a finite number"),
        ({"zero_rad": float("inf")}, "zero_rad must be a finite number"),
        ({"max_speed_rad_s": 0.0}, "above zero"),
        ({"max_accel_rad_s2": -1.0}, "above zero"),
    ],
)
def test_a_wrong_servo_is_named(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        ServoSpec(**{**GOOD, **MOTION, **changes})
    assert "'jaw'" in str(caught.value)


def test_two_servos_with_one_id_are_refused() -> None:
    servo = ServoSpec(**GOOD, **MOTION)
    with pytest.raises(ValueError, match="two servos have the id 1"):
        drivers.open_bus("dynamixel", [servo, servo], port="/dev/null")
    with pytest.raises(ValueError, match="at least one servo"):
        drivers.open_bus("dynamixel", [], port="/dev/null")


def test_an_unknown_model_is_a_driver_error() -> None:
    with pytest.raises(DriverError, match="zx999"):
        drivers.open_bus("dynamixel", [ServoSpec(**{**GOOD, **MOTION, "model": "zx999"})], port="/dev/null")


def test_a_missing_vendor_package_breaks_only_its_own_kind(root: Path) -> None:
    program = """
import sys
sys.modules["dynamixel_sdk"] = None
import drivers, drivers.base.bus, drivers.base.errors
try:
    drivers.open_bus("dynamixel", [], port="x")
except drivers.base.errors.DriverError as error:
    assert "dynamixel_sdk" in str(error) and "pip install" in error.hint, error
else:
    raise SystemExit("no error")
"""
    subprocess.run([sys.executable, "-c", program], check=True, cwd=root)


def test_importing_the_room_loads_no_driver(root: Path) -> None:
    program = (
        "import sys, drivers, drivers.base.bus; sys.exit('serial' in sys.modules or 'dynamixel_sdk' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=root)


def test_counters_by_kind_and_servo() -> None:
    report = BusReport()
    assert not any(report.as_dict().values())
    report.count("no_reply", 3)
    report.count("no_reply", 3)
    report.count("port_lost")
    assert report.errors == {"no_reply": 2, "port_lost": 1}
    assert report.errors_by_servo == {3: {"no_reply": 2}}
    assert report.as_dict()["errors"] == report.errors


def test_frozen_copies() -> None:
    source = np.zeros(3)
    copy = frozen(source)
    source[0] = 1.0
    assert copy[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        copy[0] = 2.0
