"""Figures of garments made for a head of smooth forms: ``python -m tests.surface.fit.wardrobe.figures`` prints them.

Where a garment is changed on purpose, figures.json is written again from what this prints, and the garment is looked
at on the shipped head.
"""
# ruff: noqa: T201 (a program that prints a file)

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np

from surface.fit.wardrobe import __main__ as program
from surface.fit.wardrobe import write
from tests.surface.fit.wardrobe.made_skin import lower_face, whole_skin

NAMES = (*program.STYLES, *program.NECKS, *program.BEARDS)
Figures = dict[str, list[list[float]]]


def figures(name: str) -> Figures:
    """By array of a garment's file: its shape; and for each column its mean, standard deviation and greatest value."""
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.object(program, "Head", mock.Mock()),
        mock.patch.object(program, "Skin", lambda head: lower_face() if name in program.BEARDS else whole_skin()),
        mock.patch.object(write, "outline", lambda data, parts: [7, len(parts)]),
    ):
        program.main("head", folder, name)
        made = dict(np.load(Path(folder) / f"{name}.npz"))
    return {key: _figures(rows) for key, rows in made.items() if rows.dtype.kind != "U"}


def _figures(rows: np.ndarray) -> list[list[float]]:
    is_picture = rows.ndim == 2 and rows.shape[1] > 16
    columns = rows.astype(float).reshape(-1, 1) if is_picture or rows.ndim == 1 else rows.astype(float)
    of_columns = (columns.mean(axis=0), columns.std(axis=0), columns.max(axis=0))
    return [list(map(float, rows.shape)), *([round(float(x), 6) for x in row] for row in of_columns)]


def main() -> None:
    """Print the table of all garments, an array a line."""
    garments = []
    for name in NAMES:
        rows = ",\n".join(f"  {json.dumps(key)}: {json.dumps(found)}" for key, found in figures(name).items())
        garments.append(f" {json.dumps(name)}: {{\n{rows}\n }}")
    print("{\n" + ",\n".join(garments) + "\n}")


if __name__ == "__main__":
    main()
