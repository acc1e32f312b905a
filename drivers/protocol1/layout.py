"""Where each model keeps the registers that a bus with Protocol 1.0 framing reads and writes every cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import Floats
from drivers.core.scale import Ticks
from drivers.servos.layout import Block, block_of, format_of, item_of
from drivers.tables.tables import ControlTable


def values_of(block: Block, replies: Sequence[bytes]) -> dict[str, NDArray[np.int64]]:
    """Values of k servos from their k replies of ``block.size`` bytes: by short name, ``(k,)``, signs applied."""
    raw = np.frombuffer(b"".join(replies), dtype=block.dtype)
    return {name: _signed(raw[name].astype(np.int64), item.sign_bit) for name, item in block.items.items()}


def _signed(raw: NDArray[np.int64], sign_bit: int | None) -> NDArray[np.int64]:
    """Values of magnitudes that have their sign in a bit."""
    if sign_bit is None:
        return raw
    magnitude = raw & ((1 << sign_bit) - 1)
    return np.where(raw >> sign_bit & 1, -magnitude, magnitude)


@dataclass(frozen=True)
class Layout:
    """What the bus reads and writes of one control table; servos that share one share their transactions.

    Attributes
    ----------
    goal : registers written every cycle, side by side: goal, and where they lie in between, time and speed.
    feedback : block read every cycle (or in turn, where servos are read one by one).
    slow : blocks read in turn.
    manner : how a group is read, see ``ControlTable.group_read``.
    """

    goal: Block
    feedback: Block
    slow: tuple[Block, ...]
    manner: str

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for layouts whose servos can share one transaction."""
        blocks = (self.goal, self.feedback, *self.slow)
        orders = tuple(item.big_endian for item in self.goal.items.values())
        return (self.manner, orders, *((block.address, block.size, tuple(block.items)) for block in blocks))


FULL = ("position", "velocity", "load", "voltage", "temperature", "hardware", "moving", "current")


def layout_of(table: ControlTable, feedback: str = "full") -> Layout:
    """Layout of a control table.

    Parameters
    ----------
    table : the model's.
    feedback : ``"full"`` reads everything that is measured, ``"position"`` position and speed only.
    """
    feetech = item_of(table, "hardware") is not None  # Dynamixel tells its state in the error byte
    full: tuple[str, ...] = FULL if feetech else FULL[:5]
    slow: list[tuple[str, ...]] = [("torque", "torque_limit")]
    if feedback != "full":
        slow.append(full[2:7])
        full = full[:2]
    blocks = tuple(block_of(table, *names) for names in slow)
    return Layout(block_of(table, "goal", "time", "speed"), block_of(table, *full), blocks, table.group_read)


class Group:
    """Servos that share their transactions.

    Parameters
    ----------
    ids : k servo ids.
    index : (k,) their places in the bus's arrays.
    tables, layout : k control tables, and the layout that they share.
    speeds : (k,) steps of their speed registers that a goal may be approached with.
    """

    def __init__(
        self,
        ids: Sequence[int],
        index: Sequence[int],
        tables: Sequence[ControlTable],
        layout: Layout,
        speeds: Sequence[int],
    ) -> None:
        self.ids, self.index, self.layout = tuple(ids), np.array(index), layout
        self.place = dict(zip(ids, index, strict=True))
        self._slot = {servo: slot for slot, servo in enumerate(self.ids)}
        names = {name for block in (layout.feedback, *layout.slow) for name in block.items}
        self._scales = {name: np.array([_scale(table, name) for table in tables]) for name in names}
        goal = layout.goal
        fields = [("id", "u1"), *((name, format_of(item)) for name, item in goal.items.items())]
        self._rows = np.zeros(len(self.ids), dtype=fields)
        self._rows["id"] = self.ids
        self._rows["speed"] = speeds

    def rows(self, ticks: Ticks, driven: NDArray[np.bool_]) -> bytes:
        """Rows of a sync write for the servos that are driven; ``(n,)`` both, of the whole bus."""
        self._rows["goal"] = ticks[self.index]
        chosen = driven[self.index]
        return (self._rows if chosen.all() else self._rows[chosen]).tobytes()

    def si(self, name: str, ids: Sequence[int], values: NDArray[np.int64]) -> Floats:
        """Values of a register in SI units."""
        scales = self._scales[name]
        slots = slice(None) if tuple(ids) == self.ids else [self._slot[servo] for servo in ids]
        out: Floats = values * scales[slots]
        return out


def _scale(table: ControlTable, name: str) -> float:
    item = item_of(table, name)
    return 1.0 if item is None else item.scale
