"""Writes drivers/tables/manual.toml from a copy of ROBOTIS' e-Manual (https://github.com/ROBOTIS-GIT/emanual).

    python docs/make_servo_tables.py FOLDER [--versions FILE] [-o drivers/tables/manual.toml]

FOLDER holds the manual's pages under ``docs/en/dxl``. Each version is the page's last commit there, or comes from
FILE, with lines ``path commit``, where the pages were saved one by one. Check the difference to the old file by eye:
the manual has changed values of a model from version to version.
"""

from __future__ import annotations

import argparse
import re
import subprocess
from pathlib import Path

from drivers.tables.tables import known_models

HEADER = """\
# Control tables as ROBOTIS' e-Manual prints them. Written by docs/make_servo_tables.py; do not edit: what omote takes
# otherwise than its page says is in tables.toml, with the reason. How to read it: drivers/tables/manual.py
"""
FAMILIES = (
    ("ax-", "docs/en/dxl/ax/{}.md"),
    ("mx1-", "docs/en/dxl/mx/{}.md"),
    ("mx-", "docs/en/dxl/mx/{}-2.md"),
    ("ym", "docs/en/dxl/y/{}-rh.md"),
    ("ph", "docs/en/dxl/p/{}-r.md"),
    ("pm", "docs/en/dxl/p/{}-r.md"),
    ("h", "docs/en/dxl/pro/{}.md"),
    ("m", "docs/en/dxl/pro/{}.md"),
    ("", "docs/en/dxl/x/{}.md"),
)
"""Beginning of a model's name -> its page; the first that fits."""
COLUMNS = {"initial": ("initial", "default"), "range": ("range",), "unit": ("unit",), "low": ("min",), "high": ("max",)}
NAMES = {
    "Protocol Version": "Protocol Type",
    "BUS Watchdog": "Bus Watchdog",
    "Registered": "Registered Instruction",
    "Sencondary ID": "Secondary ID",
    "Sencondary(Shadow) ID": "Secondary(Shadow) ID",
    "Hybrid Saveve": "Hybrid Save",
    "Baud Rate (Bus)": "Baud Rate",
}
"""Names that pages of other ages or with misprints use, and the usual ones."""


def main() -> None:
    """Read the arguments and write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--versions", type=Path, help="lines 'path commit' instead of git's")
    parser.add_argument("-o", type=Path, default=Path("drivers/tables/manual.toml"))
    options = parser.parse_args()
    versions = dict(line.split() for line in options.versions.read_text().splitlines()) if options.versions else None
    options.o.write_text(table_text(options.folder, versions), encoding="utf-8")


def table_text(folder: Path, versions: dict[str, str] | None = None) -> str:
    """The whole file for the models whose pages are in `folder`; `versions` : path -> commit, None asks git."""
    read: dict[str, dict[str, str]] = {}
    parts = [HEADER]
    for model in sorted(known_models().values()):
        path = page_path(model)
        if not (folder / path).is_file():
            continue
        cells = read_cells((folder / path).read_text(encoding="utf-8"))
        version = versions[path] if versions is not None else last_commit(folder, path)
        parts.append(_section(model, path, version, cells, read))
        read[model] = cells
    return "\n".join(parts)


def page_path(model: str) -> str:
    """Where the manual has the page of a model."""
    pattern = next(pattern for start, pattern in FAMILIES if model.startswith(start))
    return pattern.format(model.replace("mx1-", "mx-"))


def last_commit(folder: Path, path: str) -> str:
    """The commit that last changed a page, 12 digits."""
    command = ["git", "-C", str(folder), "log", "-1", "--abbrev=12", "--format=%h", "--", path]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def read_cells(text: str) -> dict[str, str]:
    """Register name -> cell ("address size access | initial | range | unit") of all tables of a page."""
    cells: dict[str, str] = {}
    heads: list[str] = []
    for line in text.splitlines():
        row = [part.strip() for part in line.strip().strip("|").split("|")]
        if row[0] == "Address":
            heads = [re.sub(r"<br ?/?>", " ", head).lower() for head in row]
        elif heads and row[0].isdigit() and len(row) >= 5:
            name = _plain(row[_name_column(heads)])
            if not name.startswith("Indirect "):
                cells[NAMES.get(name, name)] = _cell(heads, row)
    return cells


def _cell(heads: list[str], row: list[str]) -> str:
    values = {}
    for key, starts in COLUMNS.items():
        at = _column(heads, starts)
        values[key] = _plain(row[at]) if 0 <= at < len(row) else ""
    span = values["range"] or (f"{values['low']} ~ {values['high']}" if values["low"].isdigit() else "")
    access = row[_column(heads, ("access",))].replace("R/RW", "RW")
    return f"{row[0]} {row[1]} {access} | {values['initial']} | {span} | {values['unit']}"


def _name_column(heads: list[str]) -> int:
    """The last that is called so: some pages of the Y-series call that of the area "Name", too."""
    return max(at for at, head in enumerate(heads) if head.startswith(("data name", "name")))


def _column(heads: list[str], starts: tuple[str, ...]) -> int:
    return next((at for at, head in enumerate(heads) if head.startswith(starts)), -1)


def _plain(cell: str) -> str:
    """A cell's text without links, breaks and other marks."""
    cell = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", cell).replace("\\", "").replace("&deg;", "°").replace("℃", "°C")
    cell = cell.replace("<sup>2</sup>", "2").replace("&amp;", "&").replace("²", "2")
    return " ".join(re.sub(r"<br ?/?>", " ", cell).replace("**", "").split())


def _section(model: str, path: str, version: str, cells: dict[str, str], read: dict[str, dict[str, str]]) -> str:
    """A model's section, as differences to that model read before which it is most like."""
    lines = [f'["{model}"]', f'page = "{path}"', f'version = "{version}"']
    best = min(read, key=lambda other: _difference(cells, read[other]), default="")
    base = read.get(best, {})
    if base and _difference(cells, base) < len(cells) // 2:
        lines.append(f'like = "{best}"')
        if missing := [name for name in base if name not in cells]:
            lines.append(f"without = {missing}".replace("'", '"'))
    else:
        base = {}
    lines.append(f'["{model}".cells]')
    lines += [f'"{name}" = "{cell}"' for name, cell in cells.items() if base.get(name) != cell]
    return "\n".join(lines) + "\n"


def _difference(cells: dict[str, str], other: dict[str, str]) -> int:
    return sum(other.get(name) != cell for name, cell in cells.items()) + sum(name not in cells for name in other)


if __name__ == "__main__":
    main()
