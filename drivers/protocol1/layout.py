"""Register layout of servos with Protocol 1.0 framing: the blocks that a bus reads, and rows of goals to write."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.core.scale import Ticks
from drivers.servos.layout import Group, Layout, block_of, format_of, item_of
from drivers.tables.tables import ControlTable

FULL = ("position", "velocity", "load", "voltage", "temperature", "hardware", "moving", "current")


def layout_of(table: ControlTable, feedback: str = "full") -> Layout:
    """Layout of a control table. The goal's block has time and speed too, where they lie beside it.

    Parameters
    ----------
    table : the model's.
    feedback : ``"full"`` reads everything that is measured, ``"position"`` position and speed only.
    """
    feetech = item_of(table, "hardware") is not None  # Dynamixel reports errors in the error byte
    full: tuple[str, ...] = FULL if feetech else FULL[:5]
    slow: list[tuple[str, ...]] = [("torque", "torque_limit")]
    if feedback != "full":
        slow.append(full[2:7])
        full = full[:2]
    blocks = tuple(block_of(table, *names) for names in slow)
    return Layout(block_of(table, "goal", "time", "speed"), block_of(table, *full), blocks, table.group_read)


class GoalRows:
    """Rows of the sync write that sends goals to a group.

    Parameters
    ----------
    group : k servos.
    speeds : (k,) steps of their speed registers that a goal may be approached with.
    """

    def __init__(self, group: Group, speeds: Sequence[int]) -> None:
        self.block, self._index = group.layout.goal, group.index
        fields = [("id", "u1"), *((name, format_of(item)) for name, item in self.block.items.items())]
        self._rows = np.zeros(len(group.ids), dtype=fields)
        self._rows["id"] = group.ids
        self._rows["speed"] = speeds

    def encode(self, ticks: Ticks, driven: NDArray[np.bool_]) -> bytes:
        """Rows of the servos that are driven; ``(n,)`` both, of the whole bus."""
        self._rows["goal"] = ticks[self._index]
        chosen = driven[self._index]
        return (self._rows if chosen.all() else self._rows[chosen]).tobytes()
