"""drivers.tables.models: models that are known, and those that are driven."""

from __future__ import annotations

import pytest

from drivers.base.errors import DriverError
from drivers.tables.models import check_dynamixel, check_feetech
from drivers.tables.tables import load_table


def test_models_that_are_only_read_say_so():
    table = load_table("ym070-210-r051")
    assert (table.driven, table.center, table.first_step, table.baud[9]) == (True, 0, -262144, 10_500_000)
    assert table["Goal Position"].upper == "Max Position Limit"
    assert [table.is_permanent(table[name].address) for name in ("ID", "Bus Watchdog", "Profile Velocity")] == [
        True, False, False
    ]  # fmt: skip
    check_dynamixel("ym070-210-r051")
    check_dynamixel("ph54-100-s500")
    hls = load_table("hls3606m")
    assert (hls.driven, hls["Goal Torque"].address, "Goal Time" in hls, hls["Secondary ID"].address) == (
        False,
        44,
        False,
        7,
    )
    with pytest.raises(DriverError, match="not driven by omote yet"):
        check_feetech("hls3606m")
    check_feetech("sts3215")
