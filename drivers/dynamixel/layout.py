"""Register layout of servos with Protocol 2.0: the blocks that a bus reads every cycle and in turn."""

from __future__ import annotations

from dataclasses import replace

from drivers.servos import layout
from drivers.servos.layout import Block, Layout
from drivers.tables.tables import ControlTable, Item

FULL = ("position", "velocity", "current")
INDIRECT = (*FULL, "temperature", "hardware", "torque", "watchdog")
"""What one request reads where indirect addresses can map registers side by side. The last four show that a servo has
lost its indirect addresses: then all of them read 0, as on no working servo (see ``Telemetry``)."""
DIRECTION_BIT = 10
"""XL-320: this bit of its speed is the direction, the rest the magnitude."""


def item_of(table: ControlTable, name: str) -> Item | None:
    """Register of a table by its short name; None: there is none. The load replaces a current that is not measured."""
    item = layout.item_of(table, "load" if name == "current" and "Present Current" not in table else name)
    return replace(item, sign_bit=DIRECTION_BIT) if item and item.name == "Present Speed" else item


def _block(table: ControlTable, *names: str) -> Block:
    return Block({name: item for name in names if (item := item_of(table, name)) is not None})


def layout_of(table: ControlTable, feedback: str = "full", indirect: Block | None = None) -> Layout:
    """Layout of a control table; ValueError where the model has no goal or no present position.

    feedback : ``"full"`` reads velocity and current with the position, ``"position"`` only the position.
    indirect : block to read instead, through indirect addresses that were set up before.
    """
    goal = _block(table, "goal")
    block = indirect or _block(table, *(FULL if feedback == "full" else FULL[:1]))
    if not goal.items or not block.items:
        raise ValueError(f"{table.model} has no goal or no present position")
    slow = [_block(table, name) for name in ("torque", "hardware", "watchdog") if name not in block.items]
    slow.append(_supply(table))
    return Layout(goal, block, tuple(block for block in slow if block.items), indirect=indirect is not None)


def _supply(table: ControlTable) -> Block:
    """Voltage and temperature, and the register before them where both would be as long as a reply to a ping."""
    block, before = _block(table, "voltage", "temperature"), table.get("Position Trajectory")
    if before is None or block.size != 3:
        return block
    return Block({"trajectory": before, **block.items})
