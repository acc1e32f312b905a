"""How far each action unit moves its landmark on a head, in mm and in share of the distance of the eyes, beside what
studies found on people.

Run ``python benchmarks/action_units.py [--head HEAD]``: seconds. benchmarks/action_units.toml has the landmarks, the
units and the sources. Studies give the largest movement of people who were asked for it.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from controller.base.paths import find_config
from surface.base.arrays import Floats
from surface.head import Head

TABLES = Path(__file__).with_suffix(".toml")
SHIPPED_MM = 63.6  # distance of the shipped head's eyes, for which the landmarks' places are given
NEAR_MM = 2.0


class Landmarks:
    """Points of a head's skin and teeth that are followed through its poses."""

    def __init__(self, head: Head, places: dict[str, dict[str, Any]]) -> None:
        self.head = head
        head.pose(head.values({}))
        eyes = np.array(head.data.eyes)
        self.between_mm = float(np.linalg.norm(eyes[0] - eyes[1]))
        middle, scale = eyes.mean(axis=0), self.between_mm / SHIPPED_MM
        self._at = {name: self._nearest(place, middle, scale) for name, place in places.items()}
        self.rest = {name: self.place(name) for name in places}

    def _nearest(self, place: dict[str, Any], middle: Floats, scale: float) -> tuple[str, int]:
        """The foremost vertex near a place seen from the front, or the nearest."""
        part = place.get("part", "face")
        points = np.asarray(self.head.part(part).vertices, float)
        at = middle[:2] + scale * (np.array(place["at"]) - [0.0, 36.1])
        away = np.hypot(*(points[:, :2] - at).T)
        near = np.flatnonzero(away <= max(NEAR_MM * scale, away.min()))
        return part, int(near[points[near, 2].argmax()])

    def place(self, name: str) -> Floats:
        """(3,) where a landmark is now, mm."""
        part, vertex = self._at[name]
        return np.array(self.head.part(part).vertices[vertex], float)

    def moved(self, name: str, weights: dict[str, float]) -> Floats:
        """(3,) how a landmark moves when parameters do, mm; a name without side is both."""
        known = set(self.head.parameters)
        sides = {key: [key] if key in known else [f"{key}Left", f"{key}Right"] for key in weights}
        sided = {name: weights[key] for key, names in sides.items() for name in names}
        self.head.pose(self.head.values(sided))
        return self.place(name) - self.rest[name]


def measured(head: Head) -> list[tuple[dict[str, Any], float, float]]:
    """Every unit with how far its landmark moves, mm, and in share of the distance of the eyes."""
    tables = tomllib.loads(TABLES.read_text())
    marks = Landmarks(head, tables["landmarks"])
    rows = []
    for unit in tables["units"]:
        way = marks.moved(unit["landmark"], unit["weights"])
        mm = float(way @ np.array(unit["along"])) if "along" in unit else float(np.linalg.norm(way))
        rows.append((unit, mm, mm / marks.between_mm))
    return rows


def _people(unit: dict[str, Any]) -> str:
    """What people do, as text; empty where no study was found."""
    return "{mean:.1f} ({spread})".format(**unit["people"]) if "people" in unit else ""


def main(head: str = typer.Option("ict", help="Head: a name from configs/heads or a folder.")) -> None:
    """Print the table."""
    console = Console()
    table = Table(
        "unit", "name", "landmark", "mm", "of the eyes' distance", "people, mm", title=f"action units of {head}"
    )
    for unit, mm, share in measured(Head.load(find_config("heads", head))):
        cells = (unit["unit"], unit["name"], unit["landmark"].replace("_", " "))
        table.add_row(*cells, f"{mm:.1f}", f"{share:.0%}", _people(unit))
    console.print(table)
    for unit in tomllib.loads(TABLES.read_text())["units"]:
        if "source" in unit:
            console.print(f"{unit['unit']:>4}  {unit['source']}", highlight=False)


if __name__ == "__main__":
    typer.run(main)
