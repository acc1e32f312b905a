"""Damaged messages of every format: ``make fuzz``.

Each message is read by a decoder that has read others before. Whatever a message holds, the decoder raises nothing,
needs at most 50 ms of processor time, gives frames of finite numbers, and takes good messages again. The same seed
damages the same messages in the same way. ``--kind landmarks`` damages MediaPipe's results alone, which the format
``json`` reads beside much else.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS, Format
from controller.formats.frame import Frame
from tests.fuzz.take_corpus import RESULTS

LONGEST_S = 0.05
_PROBE = 200
_UNTIL = 130
"""Good messages after which a format that names its columns now and then must have named them again."""
LANDMARKS = "landmarks"


@dataclass
class Findings:
    """What a run showed; ``faults`` : what must not be, each kind with its count and the first message."""

    messages: int = 0
    frames: int = 0
    slowest_s: float = 0.0
    faults: Counter[str] = field(default_factory=Counter)
    first: dict[str, bytes] = field(default_factory=dict)

    def fault(self, what: str, message: bytes) -> None:
        """Note a fault."""
        self.faults[what] += 1
        self.first.setdefault(what, message)

    def __str__(self) -> str:
        faults = dict(self.faults) or "none"
        return (
            f"{self.messages} messages, {self.frames} frames, slowest {1e3 * self.slowest_s:.1f} ms; faults: {faults}"
        )


def attack(form: Format, count: int, seed: int, good: Sequence[bytes] = ()) -> Findings:
    """Feed damaged messages of one format to one decoder; ``good`` : what is damaged, faces without it."""
    found, decoder, encoder = Findings(), form.decoder(P), form.encoder(P)
    draw = random.Random(f"{seed} {form.kind}")
    for n, message in zip(range(count), damaged(form, draw, good), strict=False):
        found.messages += 1
        begin_s = time.thread_time()
        try:
            frames = decoder.feed(message)
        except Exception as error:  # noqa: BLE001  what is looked for
            found.fault(f"{form.kind}: {type(error).__name__}: {error}", message)
            continue
        spent_s = time.thread_time() - begin_s
        found.slowest_s = max(found.slowest_s, spent_s if spent_s <= LONGEST_S else again_s(form, message))
        found.frames += len(frames)
        if not all(np.isfinite(frame.values[frame.mask]).all() for frame in frames):
            found.fault(f"{form.kind}: values that are not numbers", message)
        faces = (each for _ in range(_UNTIL) for each in encoder.encode(_face(draw)))
        if n % _PROBE == 0 and not any(decoder.feed(each) for each in faces):
            found.fault(f"{form.kind}: good messages are not taken any more", message)
    return found


def again_s(form: Format, message: bytes) -> float:
    """Processor time of a message that took long, at its best: what a host takes of a virtual processor is counted as
    the process's own, and so is a page that must be fetched."""
    times_s = []
    for _ in range(3):
        decoder, begin_s = form.decoder(P), time.thread_time()
        decoder.feed(message)
        times_s.append(time.thread_time() - begin_s)
    return min(times_s)


def results() -> list[bytes]:
    """Results of MediaPipe's face landmarker, as messages."""
    return [json.dumps(each).encode() for each in RESULTS]


def damaged(form: Format, draw: random.Random, good: Sequence[bytes] = ()) -> Iterator[bytes]:
    """Messages with bytes changed, left out, doubled, put together, and made of nothing but chance, without end."""
    encoder = form.encoder(P)
    if not good:
        good = [message for _ in range(20) for message in encoder.encode(_face(draw))]
        good += results() * 3 if form.kind == "json" else []
    while True:
        message = bytearray(draw.choice(good))
        for _ in range(draw.choice((1, 1, 2, 5, 40))):
            damage(message, draw.choice(good), draw)
        yield bytes(message[: form.most])


def damage(message: bytearray, other: bytes, draw: random.Random) -> None:
    """Change some bytes of a message; ``other`` : what it may be put together with."""
    at, size = draw.randrange(len(message) + 1), draw.choice((1, 1, 2, 4, 8, 60))
    what = draw.randrange(9)
    if what == 0:
        message[at : at + size] = draw.randbytes(size)
    elif what == 1:
        del message[at : at + size]
    elif what == 2:
        message[at:at] = message[at : at + size] * draw.choice((1, 2, 50))
    elif what == 3:
        message[at:] = other[draw.randrange(len(other)) :]
    elif what == 4:
        message[at : at + 4] = draw.choice(_EDGES)
    elif what == 5:
        del message[at:]
    elif what == 6:
        message[:] = draw.randbytes(draw.randrange(600))
    elif what == 7 and (number := _NUMBER.search(message, at)):
        message[number.start() : number.end()] = draw.choice(_NUMBERS)
    elif at < len(message):
        message[at] ^= 1 << draw.randrange(8)


_EDGES = (
    b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\x80\0\0\0", b"\x7f\xc0\0\0", b"\x7f\x80\0\0",
    b"#bundle\0",    b"1e999", b"-", b"nan", b"|", b"&", b"#", b",", b"{", b"[[[[[[[[", b'"', b"\\u0000",
    b"=head#", b"999999999999999999",
)  # fmt: skip

_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_NUMBERS = (
    b"0", b"-0.0", b"1", b"4.0001", b"-7", b"1e-308", b"1e14", b"-1e14", b"1e15", b"1e308", b"1e999", b"NaN",
    b"Infinity", b"9" * 400, b"true", b"null", b'"0.5"', b"[]", b"{}", b"0.5,0.5",
)  # fmt: skip
"""What numbers of text become: edges of what is taken, and what is no number."""


def _face(draw: random.Random) -> Frame:
    values = np.array([draw.uniform(low, high) for low, high in zip(P.low, P.high, strict=True)])
    return Frame(values, np.ones(len(P), dtype=bool), draw.uniform(0.0, 1e5))


def main() -> int:
    """Run for all formats; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000, help="messages of each format")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", action="append", help=f"only this format, or {LANDMARKS}")
    given = parser.parse_args()
    failed = False
    for kind in given.kind or [*FORMATS.kinds(), LANDMARKS]:
        form, good = (FORMATS.get("json"), results()) if kind == LANDMARKS else (FORMATS.get(kind), [])
        found = attack(form, given.count, given.seed, good)
        failed |= bool(found.faults) or found.slowest_s > LONGEST_S
        print(f"{kind}: {found}", flush=True)
        for what, message in found.first.items():
            print(f"  {what}: {message.hex()}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
