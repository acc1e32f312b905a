"""How many bytes one cycle of a bus of servos puts on the wire; docs/drivers.md counts them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from drivers.tables.tables import load_table

_PROTOCOL_2 = (60, 22)
"""Bytes of a cycle, and of each servo in it: sync write of goals 14 + 5 n, sync read 14 + n and its replies 15 n, and
slow values of a few servos."""
_SYNC_READ_1 = (92, 29)
"""The same for Protocol 1.0 framing where all servos are read together: sync write 8 + 7 n, sync read 8 + n, replies
21 n, and slow values."""


def cycle_bytes(models: Sequence[str]) -> float:
    """Bytes of one write and one read of n servos of these models; infinity where servos are read one by one.

    Raises DriverError for an unknown model.
    """
    tables = [load_table(model) for model in models]
    if all(table.protocol == 2 for table in tables):
        fixed, each = _PROTOCOL_2
    elif all(table.group_read == "sync" for table in tables):
        fixed, each = _SYNC_READ_1
    else:
        return math.inf
    return fixed + each * len(tables)
