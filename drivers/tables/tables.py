"""Control tables of Dynamixel and Feetech servos: the registers of each model with addresses, units and limits.

Addresses and sizes of Protocol 2.0 models come from the table files that ship with dynamixel-sdk, initial values,
ranges and units of each Dynamixel from its page of the manual (`manual.toml`); `tables.toml` adds what both lack
(access, signs, limits by other registers) and corrects mistakes; `legacy.toml` holds the models with Protocol 1.0
framing, `motors.toml` what the makers say of their motors. Each table is built when it is first used.
"""

from __future__ import annotations

import importlib.util
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal

from drivers.base.errors import DriverError
from drivers.tables import manual

MAGNITUDE_BIT = 1024
"""XL-320: bit 10 of speed and load is the direction, the rest the magnitude."""
TRIPPED = 0xFF
"""Value of the bus watchdog's register after it has stopped the servo."""
FEETECH = ("sts", "sm", "scs", "hls")
"""What the names of Feetech's models begin with."""


@dataclass(frozen=True, slots=True)
class Item:
    """One entry of a control table.

    name : vendor's name, for example ``"Goal Position"``.
    address, size : first address and bytes (1, 2 or 4, little-endian).
    signed : two's complement.
    writable : whether a host may write it.
    initial : value after a factory reset (for RAM items: after power-up).
    minimum, maximum : fixed range; outside it a write is refused with Data Range (4). None = the size's own.
    values : the only values allowed, or None.
    lower, upper : names of the registers that bound it (a symmetric limit has ``lower`` None); outside them a
        write is refused with Data Limit (6).
    scale, unit : value of one step in SI units, and the unit's symbol ("" and 1.0 where it has none).
    sign_bit : the value is a magnitude with its sign in this bit (Feetech, and speeds of AX and MX), or None.
    big_endian : high byte first (Feetech SCS).
    """

    name: str
    address: int
    size: int
    signed: bool = False
    writable: bool = True
    initial: int = 0
    minimum: int | None = None
    maximum: int | None = None
    values: tuple[int, ...] | None = None
    lower: str | None = None
    upper: str | None = None
    scale: float = 1.0
    unit: str = ""
    sign_bit: int | None = None
    big_endian: bool = False

    @property
    def end(self) -> int:
        """First address after the item."""
        return self.address + self.size

    def encode(self, value: int) -> bytes:
        """`value` as the item's bytes; a value that does not fit is cut to the item's bits."""
        raw = value if self.sign_bit is None else to_magnitude(value, self.sign_bit)
        return (raw & ((1 << 8 * self.size) - 1)).to_bytes(self.size, self._order)

    def decode(self, data: bytes | bytearray | memoryview) -> int:
        """The item's value in its `size` bytes of `data`."""
        raw = int.from_bytes(data[: self.size], self._order, signed=self.signed)
        return raw if self.sign_bit is None else from_magnitude(raw, self.sign_bit)

    @property
    def _order(self) -> Literal["little", "big"]:
        return "big" if self.big_endian else "little"


def to_magnitude(value: int, sign_bit: int) -> int:
    """Magnitude with the sign in a separate bit; a magnitude that does not fit is cut to the largest."""
    magnitude = min(abs(value), (1 << sign_bit) - 1)
    return magnitude | 1 << sign_bit if value < 0 else magnitude


def from_magnitude(raw: int, sign_bit: int) -> int:
    """The inverse of `to_magnitude`."""
    magnitude = raw & (1 << sign_bit) - 1
    return -magnitude if raw >> sign_bit & 1 else magnitude


@dataclass(frozen=True, slots=True)
class Motor:
    """What the maker says of a servo's motor.

    supply_v : supply at which the others were measured, volts. lowest_v, highest_v : range of supply.
    no_load_rpm : no-load speed, rev/min. stall_nm, stall_a : torque and current at stall (P-series: continuous).
    play_arcmin : gear play, 0 where its specification states none.
    """

    supply_v: float
    lowest_v: float
    highest_v: float
    no_load_rpm: float
    stall_nm: float
    stall_a: float
    play_arcmin: float = 0.0

    @property
    def no_load_rad_s(self) -> float:
        """No-load speed, rad/s."""
        return self.no_load_rpm * math.pi / 30.0


class ControlTable(Mapping[str, Item]):
    """The items of one model and firmware, by name.

    model, number, firmware : ``"xl330-m288"``, 1200, 52.
    protocol : 1 or 2: its framing.
    group_read : how many servos are read at once with Protocol 1.0 framing: ``"sync"``, ``"bulk"``, or ``""`` for
        one by one.
    lock : what closes the EEPROM to writes: ``"torque"``, or ``"Lock"`` for the register of that name.
    top_speed : no-load speed in steps of its speed register; 0 = the initial Velocity Limit.
    motor : what its maker says of its motor, or None.
    items : by name, in order of address.
    eeprom_end : first RAM address; everything below keeps its value without power and is locked under torque.
    size : bytes of the whole table.
    ticks_per_turn, turn_rad, center : position steps over `turn_rad` radians, and the step of the zero angle.
    baud : bits per second by value of Baud Rate.
    voltage : usual supply, in 0.1 V.
    hardware_error : bit by cause (``voltage``, ``temperature``, ``overload`` ...) of Hardware Error Status and
        Shutdown; the XL-320 orders them differently from every other model.
    indirect : (first Indirect Address, first Indirect Data, slots) of each indirect area.
    play_arcmin : gear play by its specification; 0 where that states none.
    motor_encoder : the encoder counts turns of the motor, before the gear; else it is at the shaft.
    error_codes : code by cause of Error Code (Y-series, which reports one code instead of bits); else empty.
    clearable_codes, holding_codes : codes that the instruction Clear ends, and those that leave the torque on.
    ram : first and end of each area below `eeprom_end` that is not permanent.
    driven : whether omote drives and simulates the model; else it only scans and monitors it.
    fast_read, time_profile, goal_torque : whether this firmware knows fast reads, the time-based profile and
        torque on by goal update.
    """

    def __init__(self, model: str, number: int, firmware: int, spec: dict[str, Any], items: list[Item]) -> None:
        self.model, self.number, self.firmware = model, number, firmware
        self.items_by_name = {item.name: item for item in sorted(items, key=lambda item: item.address)}
        self.eeprom_end: int = spec["eeprom_end"]
        self.size = max(item.end for item in items)
        self.ticks_per_turn: int = spec["ticks_per_turn"]
        self.turn_rad: float = spec["turn_rad"]
        self.center: int = spec["center"]
        self.protocol: int = spec.get("protocol", 2)
        self.group_read: str = spec.get("group_read", "")
        self.lock: str = spec.get("lock", "torque")
        self.motor = Motor(*spec["motor"]) if "motor" in spec else None
        self.top_speed: int = self._no_load_steps() or spec.get("top_speed", 0)
        self.baud = _bit_rates(spec)
        self.voltage: int = round(10.0 * self.motor.supply_v) if self.motor else spec["voltage"]
        self.indirect: tuple[tuple[int, int, int], ...] = tuple(tuple(area) for area in spec.get("indirect", ()))
        self.hardware_error: dict[str, int] = spec["hardware_error"]
        self.error_codes: dict[str, int] = spec.get("error_codes", {})
        self.clearable_codes = frozenset(spec.get("clearable_codes", ()))
        self.holding_codes = frozenset(spec.get("holding_codes", ()))
        self.ram: tuple[tuple[int, int], ...] = tuple(tuple(area) for area in spec.get("ram", ()))
        self.driven: bool = spec.get("driven", True)
        self.play_arcmin: float = self.motor.play_arcmin if self.motor else spec.get("play_arcmin", 0.0)
        self.motor_encoder: bool = spec.get("motor_encoder", False)
        self.fast_read = 0 < spec.get("fast_read_firmware", 0) <= firmware
        self.time_profile = 0 < spec.get("time_profile_firmware", 0) <= firmware
        self.goal_torque = 0 < spec.get("goal_torque_firmware", 0) <= firmware

    def __getitem__(self, name: str) -> Item:
        try:
            return self.items_by_name[name]
        except KeyError:
            raise KeyError(f"{self.model} has no item {name!r}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.items_by_name)

    def __len__(self) -> int:
        return len(self.items_by_name)

    def _no_load_steps(self) -> int:
        item = self.get("Present Velocity") or self.get("Present Speed")
        return round(self.motor.no_load_rad_s / item.scale) if self.motor and item else 0

    @property
    def rad_per_tick(self) -> float:
        """Angle of one position step."""
        return self.turn_rad / self.ticks_per_turn

    def is_permanent(self, address: int) -> bool:
        """Whether what lies at an address outlasts the supply, and is closed to writes while the motor is on."""
        return address < self.eeprom_end and not any(first <= address < end for first, end in self.ram)

    @property
    def play_ticks(self) -> float:
        """Gear play that the encoder sees, in steps; 0 where none is stated, or where the encoder is at the motor."""
        return 0.0 if self.motor_encoder else math.radians(self.play_arcmin / 60.0) / self.rad_per_tick

    @property
    def first_step(self) -> int:
        """The position step at which the turn begins: 0, or half a turn below 0 (P-series)."""
        return self.center - self.ticks_per_turn // 2

    @cached_property
    def by_address(self) -> dict[int, Item]:
        """The items by their first address."""
        return {item.address: item for item in self.items_by_name.values()}


def _bit_rates(spec: dict[str, Any]) -> tuple[int, ...]:
    """Bits per second by value of Baud Rate."""
    if "baud_divider" not in spec:
        return tuple(spec["baud"])
    extra = spec.get("baud_extra", {})
    return tuple(extra.get(str(value), round(spec["baud_divider"] / (value + 1))) for value in range(255))


@lru_cache(maxsize=1)
def _data() -> dict[str, Any]:
    """The sections of both files, merged."""
    data: dict[str, Any] = {}
    for name in ("tables.toml", "legacy.toml"):
        part = tomllib.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))
        for section, entries in part.items():
            data.setdefault(section, {}).update(entries)
    return data


@lru_cache(maxsize=1)
def _folder() -> Path:
    """Folder of the SDK's table files, found without importing the SDK."""
    spec = importlib.util.find_spec("dynamixel_easy_sdk")
    if spec is None or spec.origin is None:
        raise DriverError(
            "control tables are missing: the installed dynamixel-sdk has no dynamixel_easy_sdk",
            hint="pip install 'dynamixel-sdk>=4.1'",
        )
    return Path(spec.origin).parent / "control_table"


@lru_cache(maxsize=1)
def known_models() -> dict[int, str]:
    """Model number -> model name (lower case with hyphens) of every table the SDK has."""
    models = {}
    for line in (_folder() / "dynamixel.model").read_text(encoding="utf-8").splitlines()[1:]:
        number, _, name = line.partition("\t")
        if name:
            models[int(number)] = name.strip().removesuffix(".model").replace("_", "-")
    models.update({int(number): name for number, name in _data()["numbers"].items()})
    return models


def model_name(number: int) -> str:
    """Name of a model number; ``"model 1234"`` where it is unknown."""
    return known_models().get(number, f"model {number}")


def model_number(model: str | int) -> int:
    """Number of a model name in any case, with ``_`` or ``-`` and with or without the connector letter.

    Raises DriverError where there is no such model; the hint lists names that look like it.
    """
    numbers = {name: number for number, name in known_models().items()}
    if isinstance(model, int):
        if model in known_models():
            return model
        raise DriverError(f"there is no control table for model number {model}", hint=_some_models(numbers, ""))
    name = model.strip().lower().replace("_", "-")
    for candidate in (name, name.removesuffix("-t").removesuffix("-r"), name.replace("xl-320", "xl320")):
        if candidate in numbers:
            return numbers[candidate]
    raise DriverError(f"there is no control table for model {model!r}", hint=_some_models(numbers, name))


def _some_models(numbers: dict[str, int], name: str) -> str:
    near = [known for known in numbers if known[:4] == name[:4]] or ["xl330-m288", "xm430-w350", "xl320"]
    return "use one of " + ", ".join(sorted(near))


def load_table(model: str | int, firmware: int | None = None) -> ControlTable:
    """Control table of a model (name or number), for a firmware version (None: a current one).

    Raises DriverError: there is no such model, its table is not described, or the SDK's files are not installed.
    """
    return _load(model_number(model), firmware)


@lru_cache(maxsize=64)
def _load(number: int, firmware: int | None) -> ControlTable:
    model = known_models()[number]
    spec = _specification(model)
    version = spec["firmware"] if firmware is None else firmware
    for since, changes in spec.get("since", {}).items():
        if version >= int(since):
            spec.update(changes)
    text = ""
    if spec.get("protocol", 2) == 2:
        path = _folder() / f"{model.replace('-', '_')}{spec.get('file', '')}.model"
        text = path.read_text(encoding="utf-8")
    identity = {"Model Number": number, "Firmware Version": version}
    items = _items(_layout(text, spec), spec, identity) + _indirect_items(spec)
    return ControlTable(model, number, version, spec, items)


def _specification(model: str) -> dict[str, Any]:
    """The model's data: its family's, changed by its series and then by the model's own."""
    data = _data()
    families = [key for key, value in data["family"].items() if model.startswith(tuple(value["prefixes"]))]
    if not families:
        raise DriverError(f"the control table of {model} is not described yet", hint=_some_models({}, ""))
    family = families[-1]
    series = next((key for key in data["series"] if model.startswith(key)), "")
    spec: dict[str, Any] = {}
    items: dict[str, dict[str, Any]] = {}
    base = data["family"].get(data["family"][family].get("extends"), {})
    above = (base, data["family"][family], data["series"].get(series, {}), data["model"].get(model, {}))
    for layer in above:
        spec.update(layer)
    page = {"items": manual.entries(model, spec["turn_rad"] / spec["ticks_per_turn"])}
    for layer in (*above, page, *(data["instead"][reason] for reason in instead(model))):
        for name, changes in layer.get("items", {}).items():
            items[name] = {**items.get(name, {}), **changes}
    spec["items"] = items
    if model in _motors():
        spec["motor"] = _motors()[model]
    return spec


def instead(model: str) -> list[str]:
    """Keys of the sections ``[instead]`` of ``tables.toml`` that hold for a model, in their order."""
    return [key for key, section in _data()["instead"].items() if model.startswith(tuple(section["models"]))]


@lru_cache(maxsize=1)
def _motors() -> dict[str, list[float]]:
    """Model -> the arguments of `Motor`."""
    return tomllib.loads(Path(__file__).with_name("motors.toml").read_text(encoding="utf-8"))


def _layout(text: str, spec: dict[str, Any]) -> dict[str, tuple[int, int]]:
    """Name -> (address, size): the SDK's file (`text`) less its aliases, plus the items it lacks."""
    drop, rename = spec.get("drop", ()), spec.get("rename", {})
    layout = {}
    _, _, table = text.partition("[control table]")
    for line in table.splitlines()[2:]:
        address, size, name = [*line.strip().split("\t"), "", ""][:3]
        if name and name not in drop:
            layout[rename.get(name, name)] = (int(address), int(size))
    for name, entry in spec["items"].items():
        if "address" in entry and not entry.get("absent"):
            layout.setdefault(name, (entry["address"], entry["size"]))
    return layout


def _items(layout: dict[str, tuple[int, int]], spec: dict[str, Any], identity: dict[str, int]) -> list[Item]:
    """Items of all registers but the indirect ones; `identity` is the initial value by name of those it has."""
    items = []
    for name, (address, size) in layout.items():
        if name.startswith("Indirect "):
            continue
        entry = spec["items"].get(name, {})
        low, high = entry.get("range", (None, None))
        lower, upper = entry.get("between", (None, entry.get("limit")))
        item = Item(
            entry.get("name", name),
            address,
            size,
            writable=entry.get("access", "rw") == "rw",
            initial=identity.get(name, entry.get("initial", 0)),
            minimum=low,
            maximum=high,
            values=tuple(entry["values"]) if "values" in entry else None,
            lower=lower,
            upper=upper,
            big_endian=spec.get("order") == "big",
            **{key: entry[key] for key in ("signed", "scale", "unit", "sign_bit") if key in entry},
        )
        items.append(item)
    return items


def _indirect_items(spec: dict[str, Any]) -> list[Item]:
    """Pointers and data of indirect areas, numbered on from area to area; a pointer's initial target is its data."""
    items = []
    low, high = spec.get("indirect_range", (0, 0))
    slot = 1
    for pointers, data, count in spec.get("indirect", ()):
        for k in range(count):
            items.append(Item(f"Indirect Address {slot}", pointers + 2 * k, 2, False, True, data + k, low, high))
            items.append(Item(f"Indirect Data {slot}", data + k, 1))
            slot += 1
    return items
