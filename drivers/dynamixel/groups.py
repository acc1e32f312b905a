"""Servos of a bus that share a transaction, and what of them it asks for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drivers.dynamixel.frames import GoalFrame, Run
from drivers.dynamixel.layout import Layout
from drivers.servos.layout import Block


class Group:
    """Servos that share one transaction because their registers lie at the same addresses.

    Parameters
    ----------
    index : (k,) their places in the bus's arrays.
    ids : k servo ids.
    layouts : their layouts.
    """

    def __init__(self, index: Sequence[int], ids: Sequence[int], layouts: Sequence[Layout]) -> None:
        self.ids = tuple(ids)
        self.index = np.array(index, np.int64)
        self.layout = layouts[0]
        names = self.layout.scales
        self.scales = {name: np.array([layout.scales[name] for layout in layouts]) for name in names}
        self.goals = GoalFrame(self.ids, self.layout.goal.address, self.layout.goal.size, self.index)
        self._slot = {servo: slot for slot, servo in enumerate(self.ids)}

    def slots(self, ids: Sequence[int]) -> slice | list[int]:
        """Places of ids within the group; all of it as a slice, which is cheaper."""
        return slice(None) if tuple(ids) == self.ids else [self._slot[servo] for servo in ids]


class Question(NamedTuple):
    """A block that some servos of a group are asked for."""

    group: Group
    block: Block
    ids: tuple[int, ...]

    @property
    def run(self) -> Run:
        """The same for the wire."""
        return Run(self.ids, self.block.address, self.block.size)

    def without(self, left_out: set[int]) -> Question:
        """The same for fewer servos."""
        return self._replace(ids=tuple(servo for servo in self.ids if servo not in left_out))


def turns_of(groups: Sequence[Group], size: int) -> list[Question]:
    """Slow values, `size` servos at a time; none where it is 0."""
    return [
        Question(group, block, group.ids[at : at + size])
        for group in groups
        for block in group.layout.slow
        for at in range(0, len(group.ids) if size else 0, max(size, 1))
    ]
