"""What decoders have in common."""

from __future__ import annotations

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import MAX_REASONS, Held, Refusals, Splitter


def test_reasons_are_counted_and_never_more_than_some() -> None:
    refused = Refusals()
    for n in range(1000):
        refused.add(f"reason {n}")
    assert len(refused) == MAX_REASONS + 1 and refused["other"] == 1000 - MAX_REASONS


def test_what_is_held_stays_until_it_is_given_again() -> None:
    held = Held(P)
    held.update({3: 0.5})
    first = held.frame(time_s=1.0)
    held.update({4: 0.25})
    second = held.frame()
    assert (first.values[3], first.mask[4], first.time_s) == (0.5, False, 1.0)
    assert (second.values[3], second.values[4], int(second.mask.sum())) == (0.5, 0.25, 2)


def test_a_stream_is_cut_at_its_delimiter_and_empty_messages_are_left_out() -> None:
    splitter = Splitter(b"##", 10, Refusals())
    assert splitter.feed(b"one##tw") == [b"one"]
    assert splitter.feed(b"o#") == []
    assert splitter.feed(b"###three##") == [b"two", b"three"]


def test_a_message_that_is_too_long_is_left_out_whole_and_counted_once() -> None:
    refused = Refusals()
    splitter = Splitter(b"##", 10, refused)
    found = [message for _ in range(50) for message in splitter.feed(b"x" * 9)]
    found += splitter.feed(b"x#") + splitter.feed(b"#good##" + b"y" * 11 + b"##also##")
    assert found == [b"good", b"also"]
    assert refused == {"message too long": 2}


def test_memory_of_a_stream_without_end_is_bounded() -> None:
    splitter = Splitter(b"\n", 100, Refusals())
    for _ in range(1000):
        splitter.feed(np.random.default_rng(1).bytes(64).replace(b"\n", b" "))
    assert len(splitter._rest) <= 200
