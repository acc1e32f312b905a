"""A decoder for each sender, the ends of streams, and what a flood may cost."""

from __future__ import annotations

from collections import Counter

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.links.net.decoding import MAX_SENDERS, MAX_WAITING, MAX_WAITING_BYTES, Decoding, _count_stale
from tests.controller.formats.faces import face

JAW = P.index("jawOpen")


def test_senders_do_not_mix() -> None:
    decoding = Decoding(FORMATS.get("json"), P, streams=False)
    found = decoding.feed([("a", b'{"jawOpen": 1}'), ("b", b'{"cheekPuff": 1}'), ("a", b'{"cheekPuff": 0.5}')])
    assert [(each.sender, int(each.frame.mask.sum())) for each in found] == [("a", 1), ("a", 2), ("b", 1)]


def test_a_stream_that_ends_begins_anew() -> None:
    decoding = Decoding(FORMATS.get("json"), P, streams=True)
    assert decoding.feed([("a", b'{"jawOpen"')]) == []
    assert decoding.feed([("a", b""), ("a", b'{"cheekPuff": 1}\n')])[0].frame.mask.sum() == 1
    assert not decoding.refused


def test_of_a_flood_only_the_newest_are_read() -> None:
    form = FORMATS.get("vmc")
    messages = [("a", message) for n in range(500) for message in form.encoder(P).encode(face(n, n / 60))]
    every = Decoding(form, P, streams=False).feed(messages)
    newest = Decoding(form, P, streams=False, newest=True).feed(messages)
    assert len(every) == 500 and len(newest) == MAX_WAITING and newest[0].skipped == 500 - MAX_WAITING
    assert (newest[-1].frame.values == every[-1].frame.values).all()
    small = [("a", b'{"jawOpen": 0.5}')] * 1000
    assert sum(len(data) for _, data in small) < MAX_WAITING_BYTES
    assert len(Decoding(FORMATS.get("json"), P, streams=False, newest=True).feed(small)) == 1000


def test_senders_without_end_take_bounded_memory() -> None:
    decoding = Decoding(FORMATS.get("json"), P, streams=False)
    for n in range(1000):
        decoding.feed([(f"10.0.0.{n}", b'{"jawOpen": 1}')])
    assert len(decoding._senders) == MAX_SENDERS


def test_strangers_do_not_displace_a_sender_that_goes_on() -> None:
    decoding = Decoding(FORMATS.get("json"), P, streams=False)
    decoding.feed([("phone", b'{"jawOpen": 1}')])
    for n in range(100):
        decoding.feed([(f"10.0.0.{n}", b'{"jawOpen": 1}')])
        ((found, *_),) = [decoding.feed([("phone", b'{"cheekPuff": 1}')])]
        assert found.frame.mask.sum() == 2, "it still knows the jaw"


def test_a_datagram_that_is_too_long_is_refused() -> None:
    decoding = Decoding(FORMATS.get("binary"), P, streams=False)
    assert decoding.feed([("a", b"x" * 5000)]) == [] and decoding.refused == Counter({"message too long": 1})


@pytest.mark.parametrize(
    ("messages", "stale"),
    [
        ([b"x" * 1024] * 64, 0),  # as much as may wait
        ([b"x" * 1024] * 65, 1),  # the last bytes above that, and 64 messages
        ([b"x" * 10] * 1000, 0),  # small ones are read all
        ([b"x" * 70_000] * 64, 0),  # few ones too
        ([b"x" * 70_000] * 66, 2),
        ([b"x" * (65_536 - 64)] + [b"x"] * 64, 0),
        ([b"x" * (65_537 - 64)] + [b"x"] * 64, 1),
    ],
)
def test_what_is_stale_is_what_neither_number_nor_size_allows(messages: list[bytes], stale: int) -> None:
    assert _count_stale(messages) == stale
