"""drivers.tables.tables: registers against the vendor's pages, and the corrections of the SDK's files."""

from __future__ import annotations

import math

import pytest

from drivers.base.errors import DriverError
from drivers.tables import tables
from drivers.tables.tables import (
    ControlTable,
    Item,
    known_models,
    load_table,
    model_name,
    model_number,
)

# address: (name, size, writable, XL330-M288 initial, XM430-W350 initial), from the e-Manual
X_SERIES = {
    0: ("Model Number", 2, False, 1200, 1020),
    7: ("ID", 1, True, 1, 1),
    8: ("Baud Rate", 1, True, 1, 1),
    9: ("Return Delay Time", 1, True, 250, 250),
    10: ("Drive Mode", 1, True, 0, 0),
    11: ("Operating Mode", 1, True, 3, 3),
    12: ("Secondary(Shadow) ID", 1, True, 255, 255),
    13: ("Protocol Type", 1, True, 2, 2),
    20: ("Homing Offset", 4, True, 0, 0),
    24: ("Moving Threshold", 4, True, 10, 10),
    31: ("Temperature Limit", 1, True, 70, 80),
    32: ("Max Voltage Limit", 2, True, 70, 160),
    34: ("Min Voltage Limit", 2, True, 35, 95),
    36: ("PWM Limit", 2, True, 885, 885),
    38: ("Current Limit", 2, True, 1750, 1193),
    44: ("Velocity Limit", 4, True, 445, 200),
    48: ("Max Position Limit", 4, True, 4095, 4095),
    52: ("Min Position Limit", 4, True, 0, 0),
    60: ("Startup Configuration", 1, True, 0, 0),
    63: ("Shutdown", 1, True, 53, 52),
    64: ("Torque Enable", 1, True, 0, 0),
    68: ("Status Return Level", 1, True, 2, 2),
    69: ("Registered Instruction", 1, False, 0, 0),
    70: ("Hardware Error Status", 1, False, 0, 0),
    76: ("Velocity I Gain", 2, True, 1600, 1920),
    78: ("Velocity P Gain", 2, True, 180, 100),
    84: ("Position P Gain", 2, True, 400, 800),
    98: ("Bus Watchdog", 1, True, 0, 0),
    100: ("Goal PWM", 2, True, 0, 0),
    102: ("Goal Current", 2, True, 0, 0),
    104: ("Goal Velocity", 4, True, 0, 0),
    108: ("Profile Acceleration", 4, True, 0, 0),
    112: ("Profile Velocity", 4, True, 0, 0),
    116: ("Goal Position", 4, True, 0, 0),
    120: ("Realtime Tick", 2, False, 0, 0),
    122: ("Moving", 1, False, 0, 0),
    123: ("Moving Status", 1, False, 0, 0),
    126: ("Present Current", 2, False, 0, 0),
    128: ("Present Velocity", 4, False, 0, 0),
    132: ("Present Position", 4, False, 0, 0),
    144: ("Present Input Voltage", 2, False, 0, 0),
    146: ("Present Temperature", 1, False, 0, 0),
    147: ("Backup Ready", 1, False, 0, 0),
}
SIGNED = {20, 100, 102, 104, 116, 124, 126, 128, 132, 136, 140}
DESCRIBED = [number for number, name in known_models().items() if name.startswith(("x", "2x", "mx"))]


@pytest.mark.parametrize("address", X_SERIES)
def test_x_series_items_are_the_vendors(address: int):
    name, size, writable, xl330, xm430 = X_SERIES[address]
    for model, initial in (("xl330-m288", xl330), ("xm430-w350", xm430)):
        item = load_table(model)[name]
        assert (item.address, item.size, item.writable, item.initial) == (address, size, writable, initial)


@pytest.mark.parametrize("number", DESCRIBED)
def test_every_described_table_is_sound(number: int):
    table = load_table(number)
    assert table["Model Number"].initial == number == table.number
    assert table["Firmware Version"].initial == table.firmware
    at = 0
    for item in table.values():
        assert item.address >= at, f"{item.name} overlaps the item before it"
        at = item.end
        assert item.size in (1, 2, 4)
        assert item.decode(item.encode(item.initial)) == item.initial
        assert item.minimum is None or item.minimum <= item.initial <= item.maximum, item.name
        assert item.values is None or item.initial in item.values
        assert all(bound is None or bound in table for bound in (item.lower, item.upper))
    assert table.size == at


@pytest.mark.parametrize("number", [number for number in DESCRIBED if number != 350])
def test_x_series_signs(number: int):
    table = load_table(number)
    assert {item.address for item in table.values() if item.signed} == SIGNED & set(table.by_address)


def test_xl320_has_a_table_of_its_own():
    table = load_table("xl320")
    addresses = {name: (item.address, item.size, item.initial) for name, item in table.items()}
    assert addresses["ID"] == (3, 1, 1)
    assert addresses["Baud Rate"] == (4, 1, 3)
    assert addresses["CCW Angle Limit"] == (8, 2, 1023)
    assert addresses["Min Voltage Limit"] == (13, 1, 60)
    assert addresses["Max Voltage Limit"] == (14, 1, 90)
    assert addresses["Shutdown"] == (18, 1, 3)
    assert addresses["Goal Position"] == (30, 2, 0)
    assert addresses["Present Position"] == (37, 2, 0)
    assert addresses["Hardware Error Status"] == (50, 1, 0)
    assert (table.eeprom_end, table.fast_read, table.indirect, table.size) == (24, False, (), 53)
    assert table.rad_per_tick * 1024 == pytest.approx(5.2359878)


@pytest.mark.parametrize(
    ("model", "firmware", "pointer", "data", "slots"),
    [
        ("xl330-m288", None, 168, 208, 20),
        ("xl330-m288", 51, 168, 224, 20),
        ("xc330-t288", 52, 168, 208, 20),
        ("xm430-w350", None, 168, 224, 56),
    ],
)
def test_indirect_area_depends_on_model_and_firmware(model, firmware, pointer, data, slots):
    table = load_table(model, firmware)
    first = table["Indirect Address 1"]
    assert (first.address, first.initial, table["Indirect Data 1"].address) == (pointer, data, data)
    assert first.writable and table["Indirect Data 1"].writable, "a host writes through the area as it reads through it"
    assert f"Indirect Data {slots}" in table
    assert f"Indirect Data {slots + 1}" not in table
    assert "Indirect Address Read" not in table


def test_hardware_error_bits_are_ordered_by_family():
    assert load_table("xl330-m288").hardware_error == {
        "voltage": 0x01,
        "temperature": 0x04,
        "encoder": 0x08,
        "shock": 0x10,
        "overload": 0x20,
    }
    assert load_table("xl320").hardware_error == {"overload": 0x01, "temperature": 0x02, "voltage": 0x04}


def test_second_indirect_area_of_the_large_models():
    table = load_table("xm430-w350")
    assert (table["Indirect Address 29"].address, table["Indirect Data 29"].address) == (578, 634)
    assert (table["Indirect Address 56"].initial, table.size) == (661, 662)


@pytest.mark.parametrize(
    ("model", "firmware", "fast"),
    [
        ("xl330-m288", 45, False),
        ("xl330-m288", 46, True),
        ("xm430-w350", 44, False),
        ("xm430-w350", 45, True),
        ("mx-28", 99, False),
        ("xl320", 99, False),
    ],
)
def test_fast_read_by_firmware(model: str, firmware: int, fast: bool):
    assert load_table(model, firmware).fast_read is fast


def test_current_is_in_milliamperes_on_the_small_series():
    # The SDK's files give XC330 a torque unit here and leave XL330 raw.
    assert load_table("xl330-m288")["Present Current"].scale == 0.001
    assert load_table("xc330-t288")["Present Current"].scale == 0.001
    assert load_table("xm430-w350")["Present Current"].scale == 0.00269
    assert "Present Current" not in load_table("xl430-w250")
    assert load_table("xl430-w250")["Present Load"].address == 126


def test_modes_of_models_without_a_current_sensor():
    for name in ("mx-28", "mx-64", "mx-106", "xl430-w250", "xc430-w150", "2xl430-w250", "xl330-m288", "xm540-w270"):
        table = load_table(name)
        assert ({0, 5} <= set(table["Operating Mode"].values)) == ("Goal Current" in table), name
    assert load_table("xl430-w250")["Operating Mode"].values == (1, 3, 4, 16)
    assert load_table("xm430-w350")["Operating Mode"].values == (0, 1, 3, 4, 5, 16)


@pytest.mark.parametrize("name", ["xm430-w350", "XM430-W350", "xm430_w350", "XM430-W350-T", "XM430-W350-R", 1020])
def test_a_model_has_many_spellings(name):
    assert load_table(name) is load_table("xm430-w350")


def test_numbers_and_names():
    assert (model_number("XL-320"), model_name(1060), model_name(9999)) == (350, "xl430-w250", "model 9999")
    assert load_table("xw430-t200").number == 1280


@pytest.mark.parametrize("model", ["xl330-m999", 4711, "rh-p12-rn"])
def test_unknown_models_name_what_there_is(model):
    with pytest.raises(DriverError, match=str(model)) as error:
        load_table(model)
    assert "xl330-m288" in error.value.hint


LEGACY = {
    "ax-12a": (
        12,
        1,
        {"ID": (3, 1), "CCW Angle Limit": (8, 1023), "Goal Position": (30, 0), "Present Temperature": (43, 0)},
    ),
    "mx1-28": (
        29,
        1,
        {"Baud Rate": (4, 34), "CCW Angle Limit": (8, 4095), "P Gain": (28, 32), "Goal Acceleration": (73, 0)},
    ),
    "sts3215": (777, 1, {"ID": (5, 1), "Homing Offset": (31, 0), "Goal Position": (42, 0), "Lock": (55, 1)}),
    "sm8512bl": (11272, 1, {"Goal Position": (42, 0), "Lock": (55, 1), "Max Position Limit": (11, 4095)}),
    "scs15": (1295, 1, {"Lock": (48, 1), "Max Position Limit": (11, 1023), "Temperature Limit": (13, 80)}),
    "scs0009": (1284, 1, {"Lock": (48, 1), "Protective Torque": (37, 40), "Present Position": (56, 0)}),
}


def test_feetech_numbers_are_the_bytes_of_series_and_model_in_the_order_of_the_series():
    numbers = {"sts3215": (9, 3), "sts3032": (9, 2), "sts3020": (9, 5), "sts3250": (9, 11), "sm8512bl": (8, 44),
        "scs0009": (5, 4), "scs15": (5, 15), "scs115": (5, 25), "hls3625": (10, 13), "hls3930": (10, 16)}  # fmt: skip
    for model, series in numbers.items():
        table = load_table(model)
        assert table["Model Number"].encode(table.number) == bytes(series), model
        assert table["Model Number"].address == 3
    assert all(not load_table(name).driven for name in known_models().values() if name.startswith("hls"))


@pytest.mark.parametrize("model", LEGACY)
def test_tables_of_protocol_1_framing(model: str):
    number, protocol, items = LEGACY[model]
    table = load_table(model)
    assert (table.number, table.protocol, table.eeprom_end) == (number, protocol, 24 if number < 100 else 40)
    assert {name: (table[name].address, table[name].initial) for name in items} == items
    assert load_table("xl330-m288").protocol == 2
    at = 0
    for item in table.values():
        assert item.address >= at, item.name
        at = item.end


def test_mx_replaces_the_compliance_of_ax_by_gains():
    assert "CCW Compliance Slope" not in load_table("mx1-28")
    assert "CW Compliance Margin" not in load_table("mx1-28")
    assert "P Gain" not in load_table("ax-12a")


def test_bit_rates_by_divider_and_by_list():
    assert [load_table("ax-12a").baud[code] for code in (1, 3, 34, 207)] == [1_000_000, 500_000, 57_143, 9_615]
    assert [load_table("mx1-28").baud[code] for code in (1, 252)] == [1_000_000, 3_000_000]
    assert load_table("sts3215").baud[4:] == (115_200, 76_800, 57_600, 38_400)


@pytest.mark.parametrize(
    ("model", "name", "value", "data"),
    [
        ("sts3215", "Goal Position", -100, "6480"),
        ("sts3215", "Homing Offset", -2047, "FF0F"),
        ("sts3215", "Present Load", -5, "0504"),
        ("sts3215", "Model Number", 777, "0903"),
        ("scs0009", "Goal Position", 258, "0102"),
        ("scs0009", "Present Velocity", -258, "8102"),
        ("ax-12a", "Present Speed", -200, "C804"),
        ("xl330-m288", "Goal Velocity", -2, "FEFFFFFF"),
    ],
)
def test_signs_and_byte_orders(model: str, name: str, value: int, data: str):
    item = load_table(model)[name]
    assert item.encode(value).hex().upper() == data
    assert item.decode(bytes.fromhex(data)) == value


def test_a_magnitude_too_large_is_cut():
    assert load_table("sts3215")["Homing Offset"].encode(-9999) == bytes.fromhex("FF0F")


def test_missing_item_names_the_model():
    with pytest.raises(KeyError, match=r"xl320 has no item 'Goal Current'"):
        load_table("xl320")["Goal Current"]


def test_sdk_without_tables_is_said(monkeypatch):
    monkeypatch.setattr(tables.importlib.util, "find_spec", lambda name: None)
    tables._folder.cache_clear()
    try:
        with pytest.raises(DriverError, match="control tables are missing") as error:
            tables._folder()
        assert "dynamixel-sdk" in error.value.hint
    finally:
        tables._folder.cache_clear()


@pytest.mark.parametrize("name", ["time_profile", "fast_read", "goal_torque"])
def test_what_came_with_a_firmware_is_known_from_it_on(name: str) -> None:
    spec = {"eeprom_end": 1, "ticks_per_turn": 2, "turn_rad": 1.0, "center": 1}
    spec |= {"voltage": 5, "hardware_error": {}, "baud": [1]}
    items = [Item("Model Number", 0, 2)]
    made = [ControlTable("m", 1, firmware, spec | {f"{name}_firmware": 3}, items) for firmware in (0, 2, 3, 4)]
    assert [getattr(table, name) for table in made] == [False, False, True, True]
    assert not getattr(ControlTable("m", 1, 9, spec, items), name), "no firmware has it"


@pytest.mark.parametrize(
    ("register", "steps"),
    [
        ("Acceleration", 100),
        ("Goal Velocity", 1),
        ("Moving Velocity Threshold", 50),
        ("Maximum Velocity Limit", 50),
        ("Maximum Acceleration", 100),
    ],
)
def test_units_of_feetech_sts_are_the_vendors_steps(register: str, steps: int) -> None:
    """Feetech's memory table of STS: steps/s or 100 steps/s² of 4096 a turn, limits by 50 steps/s."""
    assert load_table("sts3215")[register].scale == pytest.approx(steps * 2 * math.pi / 4096)
