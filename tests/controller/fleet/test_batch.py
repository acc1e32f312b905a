"""controller.fleet.batch: faces of many heads in one message come back bit for bit, and damaged ones are refused."""

from __future__ import annotations

import struct
import time

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.fleet.batch import Batches, Gathering
from controller.fleet.payload import Payloads

RNG = np.random.default_rng(8)
FACES = RNG.uniform(P.low, P.high, (5, len(P)))
NAMES = ("maple", "oak", "Ahorn-Ö", "h4", "h5")


def packed(payloads: Payloads, faces: np.ndarray = FACES) -> list[tuple[str, int, int, bytes]]:
    return [
        (name, 2**40 + i, -i, payloads.encode(face)) for i, (name, face) in enumerate(zip(NAMES, faces, strict=True))
    ]


@pytest.mark.parametrize(("kind", "off"), [("exact", 0.0), ("json", 0.0), ("binary", 0.51 / 16384)])
def test_every_face_comes_back_with_its_head_sequence_and_stamp(kind: str, off: float) -> None:
    payloads = Payloads(P, kind)
    batches = Batches(payloads)
    found = list(Batches(Payloads(P)).decode(batches.encode(packed(payloads)), batches.encoding))
    assert [face[:3] for face in found] == [(name, 2**40 + i, -i) for i, name in enumerate(NAMES)]
    np.testing.assert_allclose([face.values for face in found], FACES, rtol=0, atol=off)


def test_an_empty_batch_has_no_faces() -> None:
    batches = Batches(Payloads(P))
    assert list(batches.decode(batches.encode([]), batches.encoding)) == []


def test_values_are_clipped_to_their_ranges() -> None:
    payloads = Payloads(P)
    batches = Batches(payloads)
    found = list(batches.decode(batches.encode(packed(payloads, 9.0 * np.sign(FACES))), batches.encoding))
    np.testing.assert_array_equal(found[0].values, np.clip(9.0 * np.sign(FACES[0]), P.low, P.high))


def test_what_is_damaged_is_refused() -> None:
    payloads = Payloads(P)
    batches = Batches(payloads)
    good, encoding = batches.encode(packed(payloads)), batches.encoding
    nan = batches.encode(packed(payloads, np.full_like(FACES, np.nan)))
    short = batches.encode([("maple", 1, 1, b"x"), ("oak", 1, 1, b"y")])
    many = struct.pack("<HHI", 1, 60000, 0)
    newer = struct.pack("<H", 9) + good[2:]
    for data, why in (
        (b"", "bytes"), (good[:-1], "add up"), (good[:20], "cut short"), (good + b"x", "add up"), (many, "cut short"),
        (newer, "version 9"), (nan, "finite"), (short, "other parameters"),
        (batches.encode([("maple", 1, -(2**63), payloads.encode(FACES[0]))]), "out of range"),
        (good[:8] + b"\xff" + good[9:], "UTF-8"), (good[:8] + b"\n" + good[9:], "names"),
    ):  # fmt: skip
        with pytest.raises(LinkError, match=why):
            list(batches.decode(data, encoding))
    with pytest.raises(LinkError, match="not understood"):
        list(batches.decode(good, "omote/exact;1"))


def test_nothing_that_arrives_ends_it() -> None:
    payloads = Payloads(P)
    batches = Batches(payloads)
    good = batches.encode(packed(payloads))
    for _ in range(2000):
        data = bytearray(good[: RNG.integers(len(good) + 1)])
        for at in RNG.integers(0, max(len(data), 1), RNG.integers(0, 4)):
            if data:
                data[at] = RNG.integers(256)
        try:
            list(batches.decode(bytes(data), batches.encoding))
        except LinkError:
            continue


def test_faces_of_a_tick_go_together() -> None:
    gathering = Gathering(3)
    assert gathering.begin(5) == (0, [])
    assert [gathering.add(name, 1, 0, b"") for name in "abc"] == [False, False, True]
    assert [name for name, *_ in gathering.take()] == ["a", "b", "c"] and gathering.take() == []


def test_a_head_that_is_mixed_no_more_delays_the_others_once() -> None:
    gathering = Gathering(3)
    gathering.begin(5)
    assert not gathering.add("a", 1, 0, b"") and not gathering.add("b", 1, 0, b"")
    now, left = gathering.begin(6)  # c did not come: what was left goes with the time at which it was mixed
    assert now == 5 and [name for name, *_ in left] == ["a", "b"]
    assert not gathering.add("a", 2, 0, b"") and gathering.add("b", 2, 0, b"")


def test_no_face_waits_long_for_those_that_are_mixed_later() -> None:
    gathering = Gathering(100)
    gathering.begin(5)
    assert not gathering.add("a", 1, 0, b"")
    time.sleep(0.004)
    assert gathering.add("b", 1, 0, b"")
