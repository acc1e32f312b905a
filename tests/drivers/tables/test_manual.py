"""Tests of the manual's cells: every model's table against its page and the SDK's file, with the listed exceptions."""

from __future__ import annotations

import importlib.util
import math
import runpy
import tomllib
from pathlib import Path

import pytest

from drivers.tables import manual, tables
from drivers.tables.tables import ControlTable, Item, instead, known_models, load_table

ROOT = Path(__file__).parents[3]
NOT_DESCRIBED = ("rh-p12-rn",)
"""Models that the SDK has a file of and omote no table."""
NEWER_FIRMWARE = {"Startup Configuration", "Backup Ready"}
"""Registers of firmware 45 and later, which older versions of a page lack."""
NO_SPECIFICATION = {"xw540-h260"}
"""Models whose motor no stored version of the manual describes: its Velocity Limit is taken for its no-load speed."""
SHORTENED = {f"Error Code History {k}" for k in range(1, 17)}
"""Rows that pages leave out behind "...", in part."""
MODELS = [model for model in known_models().values() if not model.startswith(NOT_DESCRIBED)]
DYNAMIXEL = [model for model in MODELS if not model.startswith((*tables.FEETECH, "rx-"))]


def sections() -> dict[str, dict[str, object]]:
    """[instead] of ``tables.toml``, by reason."""
    text = (ROOT / "drivers/tables/tables.toml").read_text(encoding="utf-8")
    return dict(tomllib.loads(text)["instead"])


def excepted(model: str) -> dict[str, dict[str, object]]:
    """What is taken otherwise than a model's page says, by item."""
    found: dict[str, dict[str, object]] = {}
    for key in instead(model):
        for name, changes in sections()[key]["items"].items():  # type: ignore[attr-defined]
            found.setdefault(name, {}).update(changes)
    return found


def test_at_least_forty_models_have_a_page_with_its_version() -> None:
    assert set(manual.pages()) == set(DYNAMIXEL)
    assert len(DYNAMIXEL) >= 60
    for model in DYNAMIXEL:
        page = manual.page(model)
        assert page is not None
        assert page.page.startswith("docs/")
        assert len(page.version) == 12
        int(page.version, 16)


@pytest.mark.parametrize("model", DYNAMIXEL)
def test_the_registers_of_a_page_are_those_of_the_table(model: str) -> None:
    """Address, size and access; those of Protocol 2.0 come from the SDK's file, so this compares both sources."""
    table, page = load_table(model), manual.page(model)
    assert page is not None
    for name, (address, size, access, *_) in page.rows.items():
        item = table[name]
        assert (item.address, item.size, item.writable) == (address, size, access == "RW"), name
    extra = {name for name in table if not name.startswith("Indirect ")} - set(page.rows)
    assert extra <= NEWER_FIRMWARE | SHORTENED


@pytest.mark.parametrize("model", [name for name in DYNAMIXEL if load_table(name).protocol == 2])
def test_the_registers_of_the_sdk_s_file_are_those_of_the_table(model: str) -> None:
    spec = importlib.util.find_spec("dynamixel_easy_sdk")
    assert spec is not None
    assert spec.origin is not None
    folder, name = Path(spec.origin).parent / "control_table", model.replace("-", "_")
    newest = folder / f"{name}_fw52.model"
    path = newest if newest.exists() else folder / f"{name}.model"
    lines = path.read_text(encoding="utf-8").partition("[control table]")[2].splitlines()[2:]
    rows = [line.strip().split("\t") for line in lines if line.strip()]
    table = load_table(model)
    aliases = ("Indirect Address Write", "Indirect Address Read", "Indirect Data Write", "Indirect Data Read")
    for address, size, sdk_name in rows:
        if sdk_name not in aliases:
            item = table[sdk_name.replace("BUS ", "Bus ").replace(" (Bus)", "")]
            assert (item.address, item.size) == (int(address), int(size)), sdk_name


@pytest.mark.parametrize("model", DYNAMIXEL)
def test_every_cell_of_a_page_holds_but_for_the_listed_exceptions(model: str) -> None:
    table, page = load_table(model), manual.page(model)
    assert page is not None
    others = excepted(model)
    for name, row in page.rows.items():
        check_cell(table, table[name], row[3:], others.get(name, {}))


def check_cell(table: ControlTable, item: Item, cell: tuple[str, str, str], but: dict[str, object]) -> None:
    """Initial value, range and unit of an item, read from the cell in another way than `manual` reads it."""
    initial, span, unit = cell
    where = f"{table.model} {item.name}: {cell}"
    first = initial.split(", ")[0].replace(",", "")
    if first.lstrip("-").isdigit() and "initial" not in but:
        assert item.initial == int(first), where
    ends = [end.strip().replace(",", "") for end in span.split("~")]
    if len(ends) == 2 and ends[0].lstrip("-").isdigit() and ends[1].isdigit() and "range" not in but:
        assert (item.minimum, item.maximum) == (int(ends[0]), int(ends[1])), where
    if "[" in unit and "scale" not in but:
        number, _, symbol = unit.partition("[")
        assert item.scale == pytest.approx(float(number) * in_si(symbol.split("]")[0], table), rel=1e-3), where


def in_si(symbol: str, table: ControlTable) -> float:
    turn = 6.283185307
    return {
        "mA": 1e-3, "V": 1.0, "mV/msec": 1.0, "%": 1e-2, "rev/min": turn / 60, "rev/min2": turn / 3600, "msec": 1e-3,
        "μsec": 1e-6, "°C": 1.0, "pulse": turn / table.ticks_per_turn, "us": 1e-6, "ms": 1e-3, "Hz": 1.0, "A": 1.0,
        "pulse/s": turn / table.ticks_per_turn, "pulse/ms": 1e3 * turn / table.ticks_per_turn,
    }[symbol]  # fmt: skip


@pytest.mark.parametrize("key", sections())
def test_every_exception_has_a_reason_and_is_needed(key: str) -> None:
    section = sections()[key]
    assert len(str(section["reason"])) > 20
    models = [model for model in DYNAMIXEL if key in instead(model)]
    assert models
    differs = False
    for model in models:
        table = load_table(model)
        read = manual.entries(model, table.rad_per_tick)
        for name, changes in section["items"].items():  # type: ignore[attr-defined]
            differs |= name in table and any(read.get(name, {}).get(entry) != changes[entry] for entry in changes)
    assert differs, "the pages say the same now"


@pytest.mark.parametrize(
    ("model", "current_a", "velocity_limit", "volts", "rpm"),
    [
        ("xh430-v350", 0.00134, 135, 24.0, 31),
        ("xh430-v210", 0.00134, 230, 24.0, 52),
        ("mx-64", 0.00336, 285, 12.0, 63),
        ("xl330-m288", 0.001, 445, 5.0, 103),
        ("xm540-w270", 0.00269, 128, 12.0, 30),
        ("ph54-200-s500", 0.001, 2900, 24.0, 33.1),
        ("ym080-230-r099", 0.01, 2020, 24.0, 32.2),
    ],
)
def test_models_differ_as_their_pages_do(
    model: str, current_a: float, velocity_limit: int, volts: float, rpm: float
) -> None:
    table = load_table(model)
    assert table["Present Current"].scale == pytest.approx(current_a)
    assert table["Velocity Limit"].initial == velocity_limit
    assert table.voltage == 10 * volts
    assert table.motor is not None
    assert table.motor.no_load_rpm == rpm
    assert table.top_speed * table["Present Velocity"].scale == pytest.approx(rpm * 0.10472, rel=0.01)


def test_y_models_have_the_gains_and_the_current_of_their_motor() -> None:
    """Those of a size of motor are the same on all pages; the current limit is the motor's most."""
    y_models = [model for model in DYNAMIXEL if model.startswith("ym")]
    assert len(y_models) == 12
    for model in y_models:
        table = load_table(model)
        gains = [table[f"{name} Gain"].initial for name in ("Velocity I", "Velocity P", "Position D")]
        assert gains == ([2585331, 26184, 9090] if model.startswith("ym070") else [5765630, 51387, 8000])
        assert table.motor is not None
        assert table["Current Limit"].initial * table["Current Limit"].scale == pytest.approx(table.motor.stall_a)


@pytest.mark.parametrize("model", DYNAMIXEL)
def test_a_motor_can_be_supplied_within_the_limits_that_its_servo_has(model: str) -> None:
    table = load_table(model)
    if table.motor is None:
        return
    assert table.motor.lowest_v <= table.motor.supply_v <= table.motor.highest_v
    assert table["Min Voltage Limit"].initial <= 10 * table.motor.supply_v <= table["Max Voltage Limit"].initial


@pytest.mark.parametrize("model", DYNAMIXEL)
def test_each_model_has_the_no_load_speed_of_its_own_motor(model: str) -> None:
    """Also where a family of models of Protocol 1.0 shares one table."""
    table = load_table(model)
    if table.motor is None:
        assert model in NO_SPECIFICATION
        return
    item = table.get("Present Velocity") or table["Present Speed"]
    assert table.top_speed * item.scale == pytest.approx(table.motor.no_load_rad_s, rel=0.01)


@pytest.mark.parametrize(
    ("model", "rpm"), [("ax-12a", 0.111), ("mx1-28", 0.114), ("mx1-106", 0.114), ("mx1-12w", 0.916)]
)
def test_a_step_of_speed_is_what_the_descriptions_below_the_tables_give(model: str, rpm: float) -> None:
    """Moving Speed (32) of the pages of AX and MX, which have no column of units."""
    for name in ("Moving Speed", "Present Speed"):
        assert load_table(model)[name].scale == pytest.approx(rpm * 2 * math.pi / 60, rel=1e-3)


def test_a_step_of_acceleration_of_mx_servos() -> None:
    """Goal Acceleration (73): 8.583 degrees/s^2 a step, and 14.3 rev/min one second after 10 were set."""
    scale = load_table("mx1-64")["Goal Acceleration"].scale
    assert scale == pytest.approx(math.radians(8.583), rel=1e-5)
    assert 10 * scale == pytest.approx(14.3 * 2 * math.pi / 60, rel=1e-3)


# ---------------------------------------------------------------------------- reading pages

PAGE = """
| Address | Size<br>(Byte) | Data Name | Access | Initial<br />Value | Range | Unit |
|:-:|:-:|:-:|:-:|:-:|:-:|:-:|
| 0 | 2 | [Model Number](#model-number) | R | 1,030 | - | - |
| 38 | 2 | [Current Limit](#x) | RW | 1,193 | 0 ~ 1,193 | 2.69 [mA] |
| 13 | 1 | [Protocol Version](#x) | RW | 2 | 1 ~ 2 | - |
| 20 | 4 | [Homing Offset](#x) | RW | 0 | -1,044,479 ~ <br>1,044,479 | 1 [pulse] |
| 108 | 4 | [Profile Acceleration](#x)|RW|0|0 ~ 32,767 <br> 0 ~ 32,737| 214.577 [rev/min<sup>2</sup>] <br>1 [ms] |
| ... | ... | ... | ... | ... | ... | ... |
| 168 | 2 | [Indirect Address 1](#x) | RW | 224 | 64 ~ 661 | - |

| Item | Meaning |
|:-:|:-:|
| 1 | not a register |
"""


def maker() -> dict[str, object]:
    """Names of the script that writes ``manual.toml``."""
    return runpy.run_path(str(ROOT / "docs/make_servo_tables.py"))


def test_the_script_reads_pages_as_the_manual_has_them() -> None:
    assert maker()["read_cells"](PAGE) == {  # type: ignore[operator]
        "Model Number": "0 2 R | 1,030 | - | -",
        "Current Limit": "38 2 RW | 1,193 | 0 ~ 1,193 | 2.69 [mA]",
        "Protocol Type": "13 1 RW | 2 | 1 ~ 2 | -",
        "Homing Offset": "20 4 RW | 0 | -1,044,479 ~ 1,044,479 | 1 [pulse]",
        "Profile Acceleration": "108 4 RW | 0 | 0 ~ 32,767 0 ~ 32,737 | 214.577 [rev/min2] 1 [ms]",
    }


def test_pages_with_a_column_for_each_end_of_a_range() -> None:
    head = "| Address | Size | Data Name | Description | Access | Initial Value | Min | Max |"
    page = head + "\n|3|1|[ID](#id)|x|RW|1|0|252|"
    assert maker()["read_cells"](page) == {"ID": "3 1 RW | 1 | 0 ~ 252 | "}  # type: ignore[operator]


def test_the_script_writes_what_it_was_written_from(tmp_path: Path) -> None:
    """Pages made of the file's own cells give the same file."""
    names = maker()
    versions = {}
    for model in manual.pages():
        page = manual.page(model)
        assert page is not None
        path = tmp_path / page.page
        path.parent.mkdir(parents=True, exist_ok=True)
        rows = [
            f"| {at} | {size} | {name} | {access} | {initial} | {span} | {unit} |"
            for name, (at, size, access, initial, span, unit) in page.rows.items()
        ]
        head = "| Address | Size(Byte) | Data Name | Access | Initial Value | Range | Unit |"
        path.write_text("\n".join([head, *rows]), encoding="utf-8")
        versions[page.page] = page.version
    text = names["table_text"](tmp_path, versions)  # type: ignore[operator]
    assert tomllib.loads(text) == tomllib.loads((ROOT / "drivers/tables/manual.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("1,044,479", [1044479]),
        ("1, 2", [1, 2]),
        ("0, 1, 3, 4, 16", [0, 1, 3, 4, 16]),
        ("-5 ~ 1,000", [-5, 1000]),
        ("-", []),
    ],
)
def test_numbers_of_a_cell(text: str, numbers: list[int]) -> None:
    assert manual.numbers(text) == numbers


# ---------------------------------------------------------------------------- a second reading


def second_reader() -> dict[str, object]:
    """Names of the script that reads a share of the cells again."""
    return runpy.run_path(str(ROOT / "docs/check_servo_tables.py"))


def page_of(model: str, **changes: str) -> str:
    """A page as the manual prints it; ``changes`` : rows by register, with _ for blanks."""
    page = manual.page(model)
    assert page is not None
    lines = ["| Address | Size | Area | Name | Access | Default | Range | Unit |", "|:-:|:-:|:-:|:-:|:-:|:-:|:-:|:-:|"]
    for name, (address, size, access, initial, span, unit) in page.rows.items():
        row = changes.get(name.replace(" ", "_"), f"{initial} | {span} | {unit}")
        lines.append(f"| {address} | {size} | RAM | [{name}](#x) | {access} | {row} |")
    return "\n".join(lines)


def test_the_second_reader_chooses_a_tenth_of_all_registers_by_its_seed() -> None:
    chosen = second_reader()["chosen"]
    tenth, every = chosen(0.1, 20), chosen(1.0, 20)  # type: ignore[operator]
    assert len(tenth) == round(0.1 * len(every)) > 350
    assert tenth == chosen(0.1, 20) != chosen(0.1, 21)  # type: ignore[operator]
    assert len({model for model, _ in tenth}) >= 60
    assert set(tenth) <= set(every)


@pytest.mark.parametrize("model", ["xm430-w350", "ph54-200-s500", "xl320", "ym080-230-r099"])
def test_the_second_reader_agrees_with_a_page_that_the_table_was_made_from(model: str, tmp_path: Path) -> None:
    page = manual.page(model)
    assert page is not None
    (tmp_path / page.page).parent.mkdir(parents=True)
    (tmp_path / page.page).write_text(page_of(model), encoding="utf-8")
    compare = second_reader()["compare"]
    verdicts = {name: compare(tmp_path, model, name) for name in page.rows}  # type: ignore[operator]
    assert {verdict for verdict, _ in verdicts.values()} == {"agree"}, verdicts


@pytest.mark.parametrize(
    ("register", "row", "why"),
    [
        ("Current Limit", "1,194 | 0 ~ 1,193 | 2.69 [mA]", "begins with 1,194, not 1193"),
        ("Current Limit", "1,193 | 0 ~ 1,194 | 2.69 [mA]", "goes from 0 ~ 1,194"),
        ("Current Limit", "1,193 | 0 ~ 1,193 | 26.9 [mA]", "counts by 26.9 [mA]"),
    ],
)
def test_the_second_reader_finds_each_kind_of_mistake(register: str, row: str, why: str, tmp_path: Path) -> None:
    page = manual.page("xm430-w350")
    assert page is not None
    (tmp_path / page.page).parent.mkdir(parents=True)
    changed = page_of("xm430-w350", **{register.replace(" ", "_"): row})
    (tmp_path / page.page).write_text(changed, encoding="utf-8")
    verdict, said = second_reader()["compare"](tmp_path, "xm430-w350", register)  # type: ignore[operator]
    assert verdict == "differ"
    assert why in said
    assert second_reader()["compare"](tmp_path, "xm430-w210", register) == ("not read", "")  # type: ignore[operator]
