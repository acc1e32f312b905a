"""What the bodies of several heads of a stage share: layers of all heads, the clock and the stop latch."""

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
    """A head among several, which :class:`controller.body.multi_head.MultiHeadBody` ticks.

    heads : all heads of the stage. clock : their common clock. stop_latch : common, so that a STOP stops all heads.
    """

    name: str
    placement: Placement
    heads: Heads
    clock: HurriedClock
    stop_latch: StopLatch

    def join(self, state: CommandState) -> None:
        """Give ``state`` the name, placement and stop latch of this head, and add it to the heads."""
        state.name, state.placement, state.heads, state.stop_latch = (
            self.name, self.placement, self.heads, self.stop_latch,
        )  # fmt: skip
        self.heads.add(state)


def options_of(options: RunOptions, name: str, *, first: bool) -> RunOptions:
    """Return the options of a run for one of its heads.

    Takes, voices, shows and panels are only for the first head. Each head has its own recording, as ``a-maple.rec`` for
    ``a.rec``.
    """
    record = options.record
    head_record = None if record is None else record.with_name(f"{record.stem}-{name}{record.suffix}")
    return replace(options, record=head_record) if first else RunOptions(mirror=options.mirror, record=head_record)
