"""A stage over Zenoh whose processes are killed, and whose network loses and delays: what the heads show meanwhile.

    python benchmarks/fleet_faults.py --kills 100             # of any role, at random, each started again
    python benchmarks/fleet_faults.py --seconds 60            # nothing fails: spread of one mark over the heads
    python benchmarks/fleet_faults.py --seconds 60 --loss 0.05 --delay-ms 50 --jitter-ms 20

A router, two conductors, two processes of two heads each, one that draws all heads, and one that records, on one
machine; with ``--loss`` or ``--delay-ms`` the heads reach the router through a proxy that drops and delays datagrams.
Every one of them is killed and started again, or stopped and continued, conductors and the router for longer than a
lease. Each process that shows or sends faces writes every tick to a file, which outlives it. Afterwards those files are
judged: speed and acceleration of all parameters against their limits, also where a face is late, whether all heads show
the same conductor two seconds after each event, and for one that does not what it waited for, whether any head went
back to a conductor that was replaced, and when each face was shown by which head. Ends with 1 where a bound is not
kept.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import random
import select
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from many_heads import free_port, make_node, route, start
from rich.console import Console
from rich.table import Table

from controller.base.clock import Clock
from controller.base.parameters import PARAMETERS as P
from controller.base.parameters import Floats
from controller.fleet.node import Node

HEADS = ("a", "b", "c", "d")
SHOWING = {"one": HEADS[:2], "two": HEADS[2:], "screen": HEADS}
"""Processes that show faces, and those of which heads: two with servos, and one that draws."""
PLACES = [(process, head) for process, heads in SHOWING.items() for head in heads]
CONDUCTORS = ("first", "second")
ROLES = {"one": "head", "two": "head", "screen": "face", "recorder": "recorder"}
LONG_PAUSE_S, PAUSE_S = (0.3, 3.0), (0.05, 1.5)
"""How long a process is stopped: a conductor or the router for longer than a lease, and another one."""
DELAY_MS = 80.0  # of the stage: a face is shown so long after it was mixed, everywhere at once
IN_STEP_S = 2.0
BESIDE_S, BESIDE_SHARE = 5e-3, 0.45
WITHIN = 1.0001
"""A limit is kept where what is measured is less than this times the limit: times are whole ns."""
RECORD = np.dtype([
    ("place", "u1"), ("head", "u1"), ("conducted", "?"), ("exact", "?"), ("fence", "<i8"), ("holder", "<u8"),
    ("sequence", "<i8"), ("mixed_ns", "<i8"), ("shown_ns", "<i8"), ("passed_s", "<f8"), ("values", "<f8", (len(P),)),
])  # fmt: skip
"""One tick of one head: ``place`` which of :data:`PLACES` shows it, ``shown_ns`` when it was written, ``passed_s`` how
far the motion of its process had come, the others of the face that is shown, or that a conductor sent; ``mixed_ns`` :
how far the motion of that conductor had come, 0 for one's own."""
EXPRESSIONS = ("happiness", "anger", "surprise", "sadness")


def play(pipe: Connection, endpoint: str, role: str, names: tuple[str, ...], path: str, delay_ms: float) -> None:
    """A process with a role: ticks until it is told to end, and writes what its heads show to ``path``."""
    more = {"delay_ms": delay_ms} if role in ("head", "face") else {"record": str(Path(path).with_suffix(""))}
    clock, shown = Clock(100.0), {name: P.neutral() for name in names}
    node, states = make_node(endpoint, role, list(names), clock, **more)
    pipe.send("ready")
    rested, count, passed_s = dict.fromkeys(names, 0.0), 0, 0.0
    with open(path, "ab", buffering=0) as file:
        for now in clock.run(lambda: not pipe.poll()):
            count, passed_s = count + 1, passed_s + clock.step_s
            rows = np.zeros(len(names), RECORD)
            for row, (name, state) in zip(rows, states.items(), strict=True):
                if node.lease.active and count % 150 == 0:
                    state.expression(EXPRESSIONS[count // 150 % 4], 1.0, None, now)
                rested[name], stamp = rested[name] + clock.step_s, 0
                if not node.rests(name):
                    stamp, rested[name] = state.tick(now, rested[name], shown[name]), 0.0
                node.relay(name, now, clock.step_s, shown[name], stamp)
                row["place"], row["head"] = place_of(path, name), HEADS.index(name)
                row["values"], row["passed_s"] = shown[name], passed_s
                _note_face(row, node, name)
            file.write(rows.tobytes())
    node.close()


def place_of(path: str, head: str) -> int:
    """Which of :data:`PLACES` writes the file; 255 for a process that shows nothing."""
    place = Path(path).stem, head
    return PLACES.index(place) if place in PLACES else 255


def _note_face(row: Any, node: Node, name: str) -> None:
    """Note whose face it is: a conductor's own, or the one that it has sent."""
    follower, token = node.followers[name], node.lease.token
    header, row["shown_ns"] = follower.header, time.monotonic_ns()
    row["conducted"], row["exact"] = follower.conducted, follower.exact
    if node.conducts and node.lease.active:
        row["fence"], row["holder"], row["sequence"] = *token, node.sequence(name)
    elif header is not None:
        row["fence"], row["holder"] = header.token
        row["sequence"], row["mixed_ns"] = header.sequence, header.time_ns


def disturb(pipe: Connection, listen: int, to: int, loss: float, delay_s: float, jitter_s: float) -> None:
    """A proxy of datagrams to a port of this machine, until told to end: drops and delays them, in both directions.

    Each way is a queue: what is late holds up what was sent after it, so the order stays.
    """
    front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    front.bind(("127.0.0.1", listen))
    ways: dict[Any, socket.socket] = {}
    waiting: list[tuple[float, int, bytes, socket.socket, Any]] = []
    numbers, count, last = random.Random(3), 0, dict[Any, float]()
    pipe.send("ready")
    while not pipe.poll():
        left = min(0.02, max(0.0, waiting[0][0] - time.monotonic())) if waiting else 0.02
        for ready in select.select([front, *ways.values()], [], [], left)[0]:
            data, whom = ready.recvfrom(1 << 16)
            if ready is front:
                if whom not in ways:
                    ways[whom] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                    ways[whom].connect(("127.0.0.1", to))
                out, target = ways[whom], None
            else:
                out, target = front, next(at for at, way in ways.items() if way is ready)
            if numbers.random() >= loss:
                count += 1
                due = max(
                    time.monotonic() + delay_s + numbers.uniform(-jitter_s, jitter_s), last.get((out, target), 0.0)
                )
                last[out, target] = due
                heapq.heappush(waiting, (due, count, data, out, target))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, data, out, target = heapq.heappop(waiting)
            out.sendto(data, target) if target else out.send(data)


@dataclass
class Fleet:
    """The processes of a stage, by name; events are times (ns) and what was done.

    endpoint : of the router, which listens at ``datagrams`` too. heads_by : where heads find it, the proxy perhaps.
    """

    endpoint: str
    datagrams: str
    heads_by: str
    folder: Path
    delay_ms: float
    running: dict[str, tuple[Any, Connection]] = field(default_factory=dict)
    events: list[tuple[int, str]] = field(default_factory=list)

    def begin(self, name: str) -> None:
        """Start the process of that name; it is ready when this returns."""
        role, names = ROLES.get(name, "conductor"), SHOWING.get(name, HEADS)
        if name == "router":
            self.running[name] = start(route, self.endpoint, self.datagrams)
        else:
            where, path = self.heads_by if role == "head" else self.endpoint, str(self.folder / f"{name}.rows")
            self.running[name] = start(play, where, role, names, path, self.delay_ms)
        self.events.append((time.monotonic_ns(), f"start {name}"))

    def kill(self, name: str) -> None:
        """Kill a process at once."""
        process, _ = self.running.pop(name)
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        self.events.append((time.monotonic_ns(), f"kill {name}"))

    def pause(self, name: str, seconds: float) -> None:
        """Stop a process for some time, as a machine that sleeps."""
        process, _ = self.running[name]
        os.kill(process.pid, signal.SIGSTOP)
        self.events.append((time.monotonic_ns(), f"pause {name}"))
        time.sleep(seconds)
        os.kill(process.pid, signal.SIGCONT)
        self.events.append((time.monotonic_ns(), f"continue {name}"))

    def end(self) -> None:
        """End all of them, the router last."""
        for name in sorted(self.running, key="router".__eq__):
            process, pipe = self.running[name]
            pipe.send("end")
            process.join(10.0)


def lives(rows: np.ndarray) -> list[np.ndarray]:
    """Rows of one head in one process, cut where that was started again."""
    cuts = np.flatnonzero(np.diff(rows["passed_s"]) <= 0.0) + 1
    return [life for life in np.split(rows, cuts) if len(life) > 2]


def over_limits(life: np.ndarray) -> tuple[float, float]:
    """The greatest speed and acceleration of a life in units of their limits.

    A step is as long as that of the process; or as the time between the two faces of a conductor that are shown, where
    that is the same but for :data:`BESIDE_S` and :data:`BESIDE_SHARE` of the longer one, because ticks of two processes
    are never of quite the same length.
    """
    before, after = life[:-1], life[1:]
    own, theirs = np.diff(life["passed_s"]), 1e-9 * np.diff(life["mixed_ns"])
    same = before["conducted"] & after["conducted"]
    same &= (before["fence"] == after["fence"]) & (before["holder"] == after["holder"])
    same &= (theirs > 0.0) & (np.abs(theirs - own) < np.minimum(BESIDE_S, BESIDE_SHARE * np.maximum(theirs, own)))
    length = np.where(same, theirs, own)[:, None]
    speed = np.diff(life["values"], axis=0) / length
    change = np.diff(speed, axis=0) / (0.5 * (length[1:] + length[:-1]))
    fastest = (np.abs(speed) / P.max_speed).max(initial=0.0)
    return float(fastest), float((np.abs(change) / P.max_acceleration).max(initial=0.0))


def steps_back(life: np.ndarray) -> int:
    """How often a head that had obeyed a conductor obeyed one with a lower token afterwards."""
    return _lower(life[life["conducted"]])


def _lower(life: np.ndarray) -> int:
    tokens = list(zip(life["fence"].tolist(), life["holder"].tolist(), strict=True))
    return sum(after < before for before, after in pairwise(tokens))


def out_of_step(rows: np.ndarray, at_ns: int) -> set[int]:
    """Places that at no time in the two seconds from ``at_ns`` on show exactly what the newest conductor sends."""
    span = rows[(rows["shown_ns"] > at_ns) & (rows["shown_ns"] <= at_ns + IN_STEP_S * 1e9)]
    joined = span["conducted"] & span["exact"] & (span["fence"] == span["fence"].max(initial=0))
    return set(span["place"].tolist()) - set(span["place"][joined].tolist())


def why_late(rows: np.ndarray, at_ns: int, place: int) -> str:
    """What a head that is not in step in time waited for: the processor, a face, or its own way to that face."""
    span = rows[(rows["place"] == place) & (rows["shown_ns"] > at_ns) & (rows["shown_ns"] <= at_ns + 2e9 * IN_STEP_S)]
    newest = span["fence"].max(initial=0)
    heard = span["conducted"] & (span["fence"] == newest)
    marks = [("a face of the newest conductor", heard), ("exactly that", heard & span["exact"])]
    found = [f"{what} after {_first_s(span, mark, at_ns)}" for what, mark in marks]
    gap = 1e-6 * np.diff(span["shown_ns"]).max(initial=0)
    process, head = PLACES[place]
    return f"{head} in {process}: {', '.join(found)}; its longest tick {gap:.0f} ms"


def _first_s(span: np.ndarray, mark: np.ndarray, at_ns: int) -> str:
    return f"{1e-9 * (int(span['shown_ns'][mark.argmax()]) - at_ns):.2f} s" if mark.any() else "more than 4 s"


def mark_spreads(rows: np.ndarray) -> Floats:
    """(k,) ms from the first to the last head that showed a face, for faces that all heads showed."""
    exact = rows[rows["exact"] & rows["conducted"]]
    first: dict[tuple[int, int], dict[int, int]] = {}
    for row in exact:
        first.setdefault((int(row["fence"]), int(row["mixed_ns"])), {}).setdefault(
            int(row["place"]), int(row["shown_ns"])
        )
    whole = [times.values() for times in first.values() if len(times) == len(PLACES)]
    return np.array([1e-6 * (max(times) - min(times)) for times in whole])


def judge(fleet: Fleet, table: Table) -> bool:
    """Fill a table with what the heads showed; whether all bounds were kept."""
    rows = _read(fleet.folder, SHOWING)
    shown = [life for place in range(len(PLACES)) for life in lives(rows[rows["place"] == place])]
    sent = [life for name in CONDUCTORS for life in _lives_of(_read(fleet.folder, [name]))]
    limits = np.array([over_limits(life) for life in [*shown, *sent]])
    back = sum(map(steps_back, shown))
    judged = judged_events(fleet.events, int(rows["shown_ns"][-1]))
    late = {(at, what): places for at, what in judged if (places := out_of_step(rows, at))}
    spreads = mark_spreads(rows)
    exact, conducted = rows["exact"].mean(), rows["conducted"].mean()
    speed, acceleration = limits.max(axis=0)
    found = {
        "ticks of heads": (len(rows), True),
        "conducted, exactly (%)": (f"{100 * conducted:.1f}, {100 * exact:.1f}", True),
        "greatest speed / limit": (f"{speed:.4f}", speed < WITHIN),
        "greatest acceleration / limit": (f"{acceleration:.4f}", acceleration < WITHIN),
        "conductors, by fencing number": (len(np.unique(rows["fence"][rows["conducted"]])), True),
        "went back to a replaced conductor": (back, back == 0),
        f"events with {IN_STEP_S:g} s until the next": (len(judged), True),
        "of these, a head not in step by then": (len(late), not late),
    }  # fmt: skip
    if len(spreads):
        p50, p99, most = np.percentile(spreads, [50, 99, 100])
        text = f"{p50:.2f}, {p99:.2f}, {most:.2f} ({len(spreads)} faces)"
        found["spread of one mark p50, p99, max (ms)"] = text, bool(p99 <= 10.0)
    for name, (value, kept) in found.items():
        table.add_row(name, str(value), "" if kept else "missed")
    for (at, what), those in late.items():
        when_s = 1e-9 * (at - fleet.events[0][0])
        table.add_row(f"{what} ({when_s:.1f} s)", "\n".join(why_late(rows, at, place) for place in those))
    return all(kept for _, kept in found.values())


def judged_events(events: list[tuple[int, str]], end_ns: int) -> list[tuple[int, str]]:
    """Those that are followed by nothing else for long enough to join, while the router runs."""
    following = [*(at for at, _ in events[1:]), end_ns]
    without = ("kill router", "pause router")
    pairs = zip(events, following, strict=True)
    return [(at, what) for (at, what), after in pairs if after - at > IN_STEP_S * 1e9 and what not in without]


def _lives_of(rows: np.ndarray) -> list[np.ndarray]:
    """Lives of all heads of one process."""
    return [life for head in range(len(HEADS)) for life in lives(rows[rows["head"] == head])]


def _read(folder: Path, names: Iterable[str]) -> np.ndarray:
    """Rows of processes in the order of time."""
    rows = np.concatenate([np.fromfile(folder / f"{name}.rows", RECORD) for name in names])
    return rows[np.argsort(rows["shown_ns"], kind="stable")]


def kill_at_random(fleet: Fleet, count: int, seed: int, until_s: float) -> int:
    """Kill, or stop and continue, and start again; returns how many events there were until the time was over."""
    numbers, done = random.Random(seed), 0
    while done < count and time.monotonic() < until_s:
        name = numbers.choice(sorted(fleet.running))
        if numbers.random() < 0.25:
            fleet.pause(name, numbers.uniform(*(LONG_PAUSE_S if name in ("router", *CONDUCTORS) else PAUSE_S)))
        else:
            fleet.kill(name)
            time.sleep(numbers.choice((0.0, numbers.uniform(0.0, 1.0))))
            fleet.begin(name)
        time.sleep(numbers.choice((0.0, IN_STEP_S + 0.3, IN_STEP_S + 1.0)))
        done += 1
    return done


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=20.0, help="without kills: how long; with: at most")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", help="folder for what was shown; made, and left there")
    parser.add_argument("--loss", type=float, default=0.0, help="share of datagrams, 0 to 1")
    parser.add_argument("--delay-ms", type=float, default=0.0)
    parser.add_argument("--jitter-ms", type=float, default=0.0)
    options = parser.parse_args()
    proxied = options.loss > 0.0 or options.delay_ms > 0.0
    tcp, udp, proxy = (free_port() for _ in range(3))
    shown_after = DELAY_MS + 2.0 * (options.delay_ms + options.jitter_ms)
    with tempfile.TemporaryDirectory() as own:
        folder = Path(options.keep or own)
        folder.mkdir(parents=True, exist_ok=True)
        by = f"udp/127.0.0.1:{proxy}" if proxied else f"tcp/127.0.0.1:{tcp}"
        way = (options.loss, options.delay_ms * 1e-3, options.jitter_ms * 1e-3)
        between = start(disturb, proxy, udp, *way)[1] if proxied else None
        fleet = Fleet(f"tcp/127.0.0.1:{tcp}", f"udp/127.0.0.1:{udp}", by, folder, shown_after)
        for name in ("router", *CONDUCTORS, *SHOWING, "recorder"):
            fleet.begin(name)
        time.sleep(3.0)
        end = time.monotonic() + options.seconds
        done = kill_at_random(fleet, options.kills, options.seed, end) if options.kills else 0
        time.sleep(max(IN_STEP_S + 1.0, 0.0 if done else end - time.monotonic()))
        fleet.end()
        if between is not None:
            between.send("end")
        (folder / "events.json").write_text(json.dumps(fleet.events))
        title = f"{done} events, {100 * options.loss:g} % loss, {options.delay_ms:g} +- {options.jitter_ms:g} ms"
        table = Table("measured", "value", "", title=title, title_justify="left")
        kept = judge(fleet, table)
    Console(width=150).print(table)
    sys.exit(not kept)


if __name__ == "__main__":
    main()
