"""What the body of a head shares with those of the other heads of its stage."""

from __future__ import annotations

from dataclasses import dataclass, replace

from controller.base.linked_clocks import HurriedClock
from controller.base.placement import Placement
from controller.base.stop_latch import StopLatch
from controller.body.messages import RunOptions
from controller.layers.commands import CommandState
from controller.layers.heads import Heads


@dataclass(frozen=True)
class Member:
    """A head among several: somebody else ticks it.

    heads : all of them. clock : theirs. stop_latch : a STOP of any stops all.
    """

    name: str
    placement: Placement
    heads: Heads
    clock: HurriedClock
    stop_latch: StopLatch

    def join(self, state: CommandState) -> None:
        """Make ``state`` one of the heads."""
        state.name, state.placement, state.heads, state.stop_latch = (
            self.name, self.placement, self.heads, self.stop_latch,
        )  # fmt: skip
        self.heads.add(state)


def options_of(options: RunOptions, name: str, *, first: bool) -> RunOptions:
    """The options of a run for one of its heads: takes, voices, shows and panels are the first head's, and each head
    has a recording of its own, ``a-maple.rec`` for ``a.rec``."""
    record = options.record
    own = None if record is None else record.with_name(f"{record.stem}-{name}{record.suffix}")
    return replace(options, record=own) if first else RunOptions(mirror=options.mirror, record=own)
