"""Cells of control tables as ROBOTIS' e-Manual prints them, read into the form of `tables`.

`manual.toml` keeps each cell as its page has it, with the page and its version; ``docs/make_servo_tables.py`` writes
that file. A model's section either has all its cells, or names the model whose page reads the same but for the cells
it lists (``like``) and those that its page lacks (``without``). A cell is ``address size access | initial value |
range | unit``; pages of MX and AX servos print no range and no unit.
"""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

VELOCITY_STEP = 0.0239691227
"""0.229 rev/min in rad/s as the SDK's ``.model`` files have it, with more digits than the manual prints."""

_TURN = 2.0 * math.pi
_UNITS = {
    "mA": (1e-3, "A"),
    "A": (1.0, "A"),
    "V": (1.0, "V"),
    "mV/msec": (1.0, "V/s"),
    "%": (0.01, "1"),
    "rev/min": (_TURN / 60.0, "rad/s"),
    "rev/min2": (_TURN / 3600.0, "rad/s2"),
    "μsec": (1e-6, "s"),
    "us": (1e-6, "s"),
    "Hz": (1.0, "Hz"),
    "msec": (1e-3, "s"),
    "ms": (1e-3, "s"),
    "°C": (1.0, "C"),
}
_PULSES = {"pulse": (1.0, "rad"), "pulse/s": (1.0, "rad/s"), "pulse/ms": (1e3, "rad/s")}
_QUANTITY = re.compile(r"([\d.,]+)\s*\[\s*([^\]]*?)\s*\]")
_WORDS = re.compile("[A-Za-z]{2}")
_NUMBER = re.compile(r"[-+]?\d[\d,]*")


@dataclass(frozen=True, slots=True)
class Page:
    """The control table of one model as the manual prints it.

    model : the model's name in omote.
    page, version : file in the repository ROBOTIS-GIT/emanual, and the commit whose text was read.
    rows : name -> (address, size, access, initial value, range, unit), the last four as printed ("" where the page
        has no such column).
    """

    model: str
    page: str
    version: str
    rows: dict[str, tuple[int, int, str, str, str, str]]


@lru_cache(maxsize=1)
def _sections() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_name("manual.toml").read_text(encoding="utf-8"))


def pages() -> tuple[str, ...]:
    """Names of the models that have a page."""
    return tuple(_sections())


@lru_cache(maxsize=64)
def page(model: str) -> Page | None:
    """A model's page, or None where there is none."""
    section = _sections().get(model)
    if section is None:
        return None
    return Page(model, section["page"], section["version"], {name: _row(cell) for name, cell in _cells(model).items()})


def _cells(model: str) -> dict[str, str]:
    """Name -> cell of a model; of the model it is like first, then its own."""
    section = _sections()[model]
    cells = {**_cells(section["like"])} if "like" in section else {}
    cells.update(section["cells"])
    return {name: cell for name, cell in cells.items() if name not in section.get("without", ())}


def _row(cell: str) -> tuple[int, int, str, str, str, str]:
    place, initial, span, unit = (part.strip() for part in cell.split("|"))
    address, size, access = place.split()
    return int(address), int(size), access, initial, span, unit


def entries(model: str, rad_per_tick: float) -> dict[str, dict[str, Any]]:
    """Item name -> the keys of ``tables.toml`` that the model's page states; empty where it has no page."""
    found = page(model)
    return {} if found is None else {name: _entry(row, rad_per_tick) for name, row in found.rows.items()}


def _entry(row: tuple[int, int, str, str, str, str], rad_per_tick: float) -> dict[str, Any]:
    _, _, _, initial, span, unit = row
    entry: dict[str, Any] = {}
    if numbers(initial) and not _WORDS.search(initial):
        entry["initial"] = numbers(initial)[0]
    entry.update(_range(span))
    entry.update(_unit(unit, rad_per_tick))
    return entry


def numbers(text: str) -> list[int]:
    """The whole numbers of a cell, without their thousands separators; "1, 2" is two numbers."""
    return [int(found.rstrip(",").replace(",", "")) for found in _NUMBER.findall(text.replace(", ", "; "))]


def _range(span: str) -> dict[str, Any]:
    """A range of numbers (the first, where the cell has one for each kind of profile), or a list of values."""
    if _WORDS.search(span):  # it names other registers, which `tables.toml` has as "limit" and "between"
        return {}
    found = numbers(span)
    if "~" in span:
        return {"range": found[:2]}
    if ", " in span:
        return {"values": found}
    return {"range": [0, found[0]]} if found else {}


def _unit(unit: str, rad_per_tick: float) -> dict[str, Any]:
    found = _QUANTITY.search(unit)
    if found is None:
        return {}
    amount, symbol = float(found[1].replace(",", "")), found[2]
    if symbol in _PULSES:
        factor, base = _PULSES[symbol]
        return {"scale": amount * factor * rad_per_tick, "unit": base}
    if (amount, symbol) == (0.229, "rev/min"):
        return {"scale": VELOCITY_STEP, "unit": "rad/s"}
    factor, base = _UNITS[symbol]
    return {"scale": float(f"{amount * factor:.9g}"), "unit": base}
