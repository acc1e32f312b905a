"""Damaged requests of the WebSocket API: ``make fuzz``.

One conversation reads them all. Whatever a request holds, it raises nothing, needs at most 50 ms of processor time, is
answered by no "fault", leaves a face of finite values inside their ranges, and the next good one is carried out. The
same seed damages the same requests in the same way.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.websocket.conversation import Conversation
from controller.links.websocket.messages import MAX_MESSAGE_BYTES
from tests.fuzz.messages import LONGEST_S, Findings, damage

GOOD: tuple[dict[str, Any], ...] = (
    {"type": "hello", "version": 1, "id": 1, "name": "fuzz"},
    {"type": "set", "parameters": {"jawOpen": 0.5, "eyeBlink_L": 1, "headYaw": -0.5}, "id": "a"},
    {"type": "release", "parameters": ["jawOpen"]}, {"type": "release"},
    {"type": "expression", "name": "happiness", "intensity": 0.8, "duration_s": 1.5},
    {"type": "expression", "name": "AU1+2+5B"}, {"type": "expression", "name": "VAD:-0.5,0.6,0.3"},
    {"type": "emotion", "valence": -0.6, "arousal": 0.4, "dominance": None, "intensity": 1},
    {"type": "gaze", "yaw_deg": 20.0, "pitch_deg": -5.0}, {"type": "gaze_at", "point_mm": [100, 0, 600]},
    {"type": "gaze_off"}, {"type": "neutral", "seconds": 0}, {"type": "life", "amount": 1, "manner": "listen"},
    {"type": "show", "name": "tour"}, {"type": "show", "action": "seek", "to": "middle"},
    {"type": "stop"}, {"type": "start"}, {"type": "get", "parameters": ["jawOpen"]}, {"type": "get"},
    {"type": "list", "what": "expressions"}, {"type": "subscribe", "rate_hz": 200}, {"type": "unsubscribe"},
    {"type": "ping", "id": 2},
)  # fmt: skip
"""A request of every kind."""
_PROBE = 200


def damaged(draw: random.Random) -> Iterator[bytes]:
    """Requests whose bytes or whose values were changed, without end."""
    texts = [json.dumps(each).encode() for each in GOOD]
    while True:
        if draw.random() < 0.5:
            yield json.dumps(_other_values(draw.choice(GOOD), draw)).encode()[:MAX_MESSAGE_BYTES]
            continue
        message = bytearray(draw.choice(texts))
        for _ in range(draw.choice((1, 1, 2, 5))):
            damage(message, draw.choice(texts), draw)
        yield bytes(message[:MAX_MESSAGE_BYTES])


def _other_values(request: dict[str, Any], draw: random.Random) -> dict[str, Any]:
    changed = dict(request)
    for key in draw.sample(sorted(changed), draw.randint(1, len(changed))):
        if key != "type" or draw.random() < 0.1:
            changed[key] = draw.choice(_VALUES)
    if draw.random() < 0.2:
        changed[draw.choice(("to", "name", "id", "x" * 300, ""))] = draw.choice(_VALUES)
    return changed


_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 0.5, 1e308, -1e308, 2**70, "", "jawOpen", "x" * 5000, "\x00", "\ud800", [], {}, [[]] * 50,
    {"jawOpen": 1e9}, {"jawOpen": None}, {"": 0}, {"jawOpen": 0.1, "JAWOPEN": 0.2}, ["jawOpen"] * 1001, "AU999",
    "VA:9,9", "../../etc/passwd", "tour", "seek", "auto", [0, 0, 0], [1e308, 0, 0], "NaN",
)  # fmt: skip


def attack(count: int, seed: int) -> Findings:
    """Feed damaged requests to one conversation with a face that moves on."""
    state, found, draw = CommandState(P), Findings(), random.Random(f"{seed} websocket")
    talk, out = Conversation(state, "fuzz", 0), P.neutral()
    for n, message in zip(range(count), damaged(draw), strict=False):
        found.messages += 1
        begin_s, now_ns = time.thread_time(), 10**9 + n * 10**6
        try:
            talk.handle(message, now_ns)
        except Exception as error:  # noqa: BLE001  what is looked for
            found.fault(f"{type(error).__name__}: {error}"[:200], message)
        found.slowest_s = max(found.slowest_s, time.thread_time() - begin_s)
        if n % 10 == 0:
            state.tick(now_ns, 0.01, out)
            if not (np.isfinite(out).all() and (P.low <= out).all() and (out <= P.high).all()):
                found.fault("the face has values out of range", message)
        if n % _PROBE == 0:
            _probe(talk, found, message, now_ns)
    found.frames = talk.accepted
    return found


def _probe(talk: Conversation, found: Findings, message: bytes, now_ns: int) -> None:
    """Look whether the next good request is carried out, and whether one met an error of omote itself."""
    reply = talk.handle('{"type": "ping", "id": 5}', now_ns)
    if reply is None or reply.id != 5:
        found.fault("the next good request is not answered", message)
    if talk.refused["fault"]:
        found.fault("an error in omote", message)
        talk.refused["fault"] = 0


def main() -> int:
    """Run; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    found = attack(given.count, given.seed)
    print(f"websocket: {found}")
    for what, message in found.first.items():
        print(f"    {what}: {message[:300]!r}")
    return 1 if found.faults or found.slowest_s > LONGEST_S else 0


if __name__ == "__main__":
    sys.exit(main())
