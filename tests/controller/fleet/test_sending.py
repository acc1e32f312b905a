"""controller.fleet.sending: which faces are sent, by publishers whose listeners are known here.

The publishers stand in for Zenoh's, which say that somebody listens when the network has told them; real ones are in
tests/controller/fleet/test_node.py and test_processes.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.fleet.payload import Header, Payloads
from controller.fleet.sending import FEW, FIRST_S, FaceSender


class Outlet:
    """A publisher; ``listens`` : whether somebody is known to listen. asked : how often that was asked."""

    def __init__(self, listens: bool) -> None:
        self.listens, self.put_count, self.asked = listens, 0, 0

    @property
    def matching_status(self) -> bool:
        self.asked += 1
        return self.listens

    def put(self, data: bytes, **more: Any) -> None:
        self.put_count += 1


def sent(heads: int, listens: bool, together: bool = False) -> tuple[int, int]:
    """How many faces, and messages of many, two ticks of heads send."""
    outlets, many = {f"head{k}": Outlet(listens) for k in range(heads)}, Outlet(together)
    sender = FaceSender(outlets, many, Payloads(P, "exact"), heading)  # type: ignore[arg-type]
    for tick in (1, 2):
        for name in outlets:
            sender.send(name, tick * 20_000_000, np.zeros(len(P)), 0)
    assert sender.sent == 2 * heads
    return sum(outlet.put_count for outlet in outlets.values()), many.put_count


def heading(sequence: int, time_ns: int, stamp_ns: int) -> Header:
    return Header((1, 1), sequence, time_ns, stamp_ns, False)  # type: ignore[arg-type]


@pytest.mark.parametrize("heads", [1, FEW])
def test_faces_of_few_heads_are_sent_before_somebody_is_known_to_listen(heads: int) -> None:
    assert sent(heads, listens=False) == (2 * heads, 0)


def test_faces_of_many_heads_are_sent_to_who_listens() -> None:
    assert sent(FEW + 1, listens=False) == (0, 0)
    assert sent(FEW + 1, listens=True) == (2 * (FEW + 1), 0)


def test_who_listens_is_asked_every_twentieth_of_a_second() -> None:
    outlets, many = {f"head{k}": Outlet(False) for k in range(FEW + 1)}, Outlet(False)
    sender = FaceSender(outlets, many, Payloads(P, "exact"), heading)  # type: ignore[arg-type]
    one = outlets["head0"]
    for tick in range(1, 11):  # of 10 ms
        one.listens = tick > 2
        for name in outlets:
            sender.send(name, tick * 10_000_000, np.zeros(len(P)), 0)
    assert (one.asked, many.asked) == (2, 2)
    assert one.put_count == 5, "from the second question on"


def test_a_tick_of_many_heads_is_one_message_to_who_hears_them_all() -> None:
    assert sent(FEW + 1, listens=False, together=True) == (0, 2)


def test_who_begins_to_conduct_sends_everything_before_somebody_is_known_to_listen() -> None:
    outlets, many = {f"head{k}": Outlet(False) for k in range(FEW + 1)}, Outlet(False)
    sender = FaceSender(outlets, many, Payloads(P, "exact"), heading)  # type: ignore[arg-type]
    end = round(FIRST_S * 1e9)
    for begin in (10**12, 10**13):
        sender.begin(begin)
        for now in (begin, begin + end - 1, begin + end, begin + 2 * end):
            for name in outlets:
                sender.send(name, now, np.zeros(len(P)), 0)
    assert [outlet.put_count for outlet in outlets.values()] == [4] * (FEW + 1) and many.put_count == 4
