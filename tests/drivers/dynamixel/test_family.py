"""drivers.dynamixel.family: the models of a bus decide which driver it has, and only what it needs is loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.family import FAMILY, driver_for
from drivers.dynamixel.legacy import LegacyBus
from drivers.dynamixel.mixed import MixedBus


def servos(*models: str) -> list[ServoSpec]:
    return [ServoSpec(i, f"s{i}", model, -1.0, 1.0, 1.0, 1.0) for i, model in enumerate(models, 1)]


def test_the_models_choose_the_driver() -> None:
    assert driver_for(servos("xl330-m288", "xl320")) is DynamixelBus
    assert driver_for(servos("ax-12a", "mx1-28")) is LegacyBus
    assert driver_for(servos("ax-12a", "xl330-m288")) is MixedBus
    with pytest.raises(DriverError, match="no-such"):
        driver_for(servos("no-such"))


def test_the_definition_is_listed_without_its_drivers() -> None:
    code = "import sys, drivers.dynamixel.family as f; print(f.FAMILY.kind, 'numpy' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split() == ["dynamixel", "False"]
    assert FAMILY.kind == "dynamixel"


def test_the_driver_of_protocol_1_is_only_loaded_where_it_is_needed() -> None:
    code = (
        "import sys\nfrom drivers.base.bus import ServoSpec\nfrom drivers.dynamixel.family import driver_for\n"
        "driver_for([ServoSpec(1, 's', 'xl330-m288', -1.0, 1.0, 1.0, 1.0)])\n"
        "print('drivers.protocol1.bus' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "False"
