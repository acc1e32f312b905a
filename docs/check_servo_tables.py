"""Reads a tenth of the cells of ROBOTIS' e-Manual a second time, by another parser, and compares them with the tables.

    python docs/check_servo_tables.py FOLDER [--share 0.1] [--seed 20] [--only ym]

FOLDER holds the manual's pages under ``docs/en/dxl``, as for make_servo_tables.py, of which this shares nothing: it
takes the columns of a row by what they hold, and compares the numbers with the finished tables, exceptions in
tables.toml applied. Registers of pages that are not in FOLDER are counted as not read. Exit code 1 where one differs.
"""

from __future__ import annotations

import argparse
import math
import random
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from drivers.tables import manual
from drivers.tables.tables import Item, instead, load_table

ROW = re.compile(
    r"^\|\s*(?P<address>\d+)\s*\|\s*(?P<size>\d)\s*\|.*?\[(?P<name>[^\]]+)\]\([^)]*\)(?P<rest>.*)\|\s*$", re.M
)
ACCESS = re.compile(r"^\**(R|RW|R/RW)\**$")
NUMBER = re.compile(r"-?\d+(?:,\d{3})*(?![\d.]*\s*\[)(?!\.)")
QUANTITY = re.compile(r"([\d,.]+)\s*\[([^\]]+)\]")
SI = {
    "mA": 1e-3, "A": 1.0, "V": 1.0, "mV/msec": 1.0, "%": 1e-2, "rev/min": math.pi / 30, "rev/min2": math.pi / 1800,
    "msec": 1e-3, "ms": 1e-3, "μsec": 1e-6, "us": 1e-6, "°C": 1.0, "Hz": 1.0,
}  # fmt: skip


def main() -> int:
    """Read the arguments, compare, and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--share", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--only", default="", help="beginning of the models' names")
    options = parser.parse_args()
    results = Counter[str]()
    for model, name in chosen(options.share, options.seed, options.only):
        verdict, why = compare(options.folder, model, name)
        results[verdict] += 1
        if why:
            sys.stdout.write(f"{model} {name}: {why}\n")
    sys.stdout.write(", ".join(f"{count} {verdict}" for verdict, count in sorted(results.items())) + "\n")
    return int(results["differ"] > 0)


def chosen(share: float, seed: int, only: str = "") -> list[tuple[str, str]]:
    """A share of the registers of all pages, always the same for a seed."""
    every = [(model, name) for model in sorted(manual.pages()) for name in sorted(rows_of(model))]
    picked = sorted(random.Random(seed).sample(every, round(share * len(every))))
    return [(model, name) for model, name in picked if model.startswith(only)]


def rows_of(model: str) -> list[str]:
    """Names of the registers that a model's page has."""
    page = manual.page(model)
    return [] if page is None else list(page.rows)


def compare(folder: Path, model: str, name: str) -> tuple[str, str]:
    """``"agree"``, ``"differ"`` or ``"not read"``, and why."""
    page = manual.page(model)
    path = folder / (page.page if page else "")
    if page is None or not path.is_file():
        return "not read", ""
    item = load_table(model)[name]
    found = [cells for address, cells in rows(path.read_text(encoding="utf-8")) if address == item.address]
    if not found:
        return "differ", f"the page has no row {item.address}"
    excepted = any(name in _items(key) for key in instead(model))
    faults = [] if excepted else list(faults_of(item, found[0], load_table(model).rad_per_tick))
    return ("differ", "; ".join(faults)) if faults else ("agree", "")


def _items(key: str) -> dict[str, object]:
    import tomllib  # only for exceptions

    text = Path(manual.__file__).with_name("tables.toml").read_text(encoding="utf-8")
    items: dict[str, object] = tomllib.loads(text)["instead"][key]["items"]
    return items


def rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Address and the cells behind the access column, of every row of a control table."""
    for match in ROW.finditer(text):
        cells = [re.sub(r"<[^>]+>|\\", " ", cell).strip() for cell in match["rest"].split("|")]
        at = next((k for k, cell in enumerate(cells) if ACCESS.match(cell)), None)
        if at is not None:
            yield int(match["address"]), cells[at + 1 :]


def faults_of(item: Item, cells: list[str], rad_per_tick: float) -> Iterator[str]:
    """What of a row's initial value, range and unit the table has otherwise."""
    initial, span, unit = [*cells, "", "", ""][:3]
    if re.fullmatch(r"-?[\d,]+", initial) and item.initial != int(initial.replace(",", "")):
        yield f"begins with {initial}, not {item.initial}"
    ends = [int(number.replace(",", "")) for number in NUMBER.findall(span)]
    if "~" in span and not re.search("[A-Za-z]{2}", span) and (item.minimum, item.maximum) != (ends[0], ends[1]):
        yield f"goes from {span}, not {item.minimum} to {item.maximum}"
    quantity = QUANTITY.search(unit.replace("²", "2").replace("rev/min 2", "rev/min2").replace("&deg;", "°"))
    if quantity:
        steps = {"pulse": rad_per_tick, "pulse/s": rad_per_tick, "pulse/ms": 1e3 * rad_per_tick}
        scale = float(quantity[1].replace(",", "")) * (SI | steps)[quantity[2].strip().replace("℃", "°C")]
        if not math.isclose(scale, item.scale, rel_tol=1e-3):
            yield f"counts by {unit}, not {item.scale:g} {item.unit}"


if __name__ == "__main__":
    sys.exit(main())
