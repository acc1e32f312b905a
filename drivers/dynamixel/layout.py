"""Where each model keeps the registers that a bus reads every cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import Floats
from drivers.servos import layout
from drivers.servos.layout import Block
from drivers.tables.tables import MAGNITUDE_BIT, ControlTable, Item


@dataclass(frozen=True)
class Layout:
    """What the bus reads and writes of one control table; servos that share addresses share a layout.

    Attributes
    ----------
    goal : register of the target.
    feedback : block read every cycle.
    slow : blocks read in turn: all that is not in ``feedback``.
    watchdog : the watchdog's register, where the model has one.
    scales : value of one step in SI units, by name; NaN where the model has no such value.
    signed_magnitude : velocity keeps its direction in bit 10 (XL-320).
    indirect : ``feedback`` is read through pointers, which a servo forgets when it reboots.
    """

    goal: Item
    feedback: Block
    slow: tuple[Block, ...]
    watchdog: Block | None
    scales: Mapping[str, float]
    signed_magnitude: bool = False
    indirect: bool = False

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for layouts whose servos can share one transaction."""
        blocks = [(block.address, block.size, tuple(block.items)) for block in (self.feedback, *self.slow)]
        return (self.goal.address, self.goal.size, *blocks)

    def speeds(self, raw: NDArray[np.integer]) -> Floats:
        """Signed steps per time of the velocity register, ``(k,) -> (k,) float64``."""
        if self.signed_magnitude:
            return np.asarray(np.where(raw & MAGNITUDE_BIT, -1.0, 1.0) * (raw & (MAGNITUDE_BIT - 1)), np.float64)
        return raw.astype(np.float64)


def item_of(table: ControlTable, name: str) -> Item | None:
    """Register of a table by its short name, the load in place of a current that is not measured; None: no such."""
    item = layout.item_of(table, name)
    return layout.item_of(table, "load") if item is None and name == "current" else item


def _block(table: ControlTable, *names: str) -> Block | None:
    items = {name: item for name in names if (item := item_of(table, name)) is not None}
    return Block(items) if items else None


FULL = ("position", "velocity", "current")
INDIRECT = (*FULL, "temperature", "hardware", "torque", "watchdog")
"""What is read in one go where registers can be mapped side by side. The last four are what tells a servo that
forgot its pointers: it reads 0 in all of them, and no servo that answers has that (see ``Telemetry``)."""


def layout_of(table: ControlTable, feedback: str = "full", indirect: Block | None = None) -> Layout:
    """Layout of a control table.

    Parameters
    ----------
    table : the model's.
    feedback : ``"full"`` reads velocity and current with the position, ``"position"`` only the position.
    indirect : block to read instead, through pointers that were set up before.
    """
    goal = item_of(table, "goal")
    block = indirect or _block(table, *(FULL if feedback == "full" else FULL[:1]))
    if goal is None or block is None:
        raise ValueError(f"{table.model} has no goal or no present position")
    blocks = [_block(table, name) for name in ("torque", "hardware", "watchdog") if name not in block.items]
    blocks.append(_supply(table))
    return Layout(
        goal,
        block,
        tuple(block for block in blocks if block is not None),
        _block(table, "watchdog"),
        _scales(table),
        signed_magnitude=table.model == "xl320",
        indirect=indirect is not None,
    )


def _scales(table: ControlTable) -> dict[str, float]:
    items = {name: item_of(table, name) for name in ("velocity", "current", "voltage", "temperature")}
    scales = {name: np.nan if item is None or item.unit == "" else item.scale for name, item in items.items()}
    if items["current"] is None or items["current"].unit != "A":
        scales["current"] = np.nan  # a load in per cent is no current
    return scales


def _supply(table: ControlTable) -> Block | None:
    """Voltage and temperature; with the item before them where both alone would be three bytes."""
    block = _block(table, "voltage", "temperature")
    before = table.get("Position Trajectory")
    if block is None or block.size != 3 or before is None:
        return block
    return Block({"trajectory": before, **block.items})
