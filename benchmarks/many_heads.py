"""Many heads from one conductor over Zenoh: what arrives, how old it is, and what each process spends on it.

Run ``python benchmarks/many_heads.py [--heads 50] [--hz 50] [--seconds 20] [--processes 2]``. A router, a conductor and
the processes with the heads are processes of their own on this machine; heads have all layers and no servos. Ages are
from when the tick was due that mixed a face to its arrival in the head's process, by the clock that all share. At last
the conductor is killed while a second one stands by: how long the heads wait.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import socket
import time
from collections.abc import Callable
from itertools import pairwise
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from controller.base.clock import Clock
from controller.base.parameters import PARAMETERS as P
from controller.fleet.lease import Token
from controller.fleet.node import Node
from controller.fleet.payload import Header
from controller.layers.commands import CommandState
from controller.stage.zenoh import ZenohSettings

ROOT = Path(__file__).resolve().parents[1]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def route(pipe: Connection, *endpoints: str) -> None:
    """The router's process, until it is told to end; then its processor time (s)."""
    import zenoh

    config = zenoh.Config()
    entries = {"mode": "router", "listen/endpoints": list(endpoints), "scouting/multicast/enabled": False}
    for key, value in entries.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config):
        pipe.send("ready")
        begin = time.process_time()
        pipe.recv()
        pipe.send(time.process_time() - begin)


def make_node(
    endpoint: str, role: str, names: list[str], clock: Clock, **more: object
) -> tuple[Node, dict[str, CommandState]]:
    states = {name: CommandState(P, seed=i) for i, name in enumerate(names)}
    for state in states.values():
        state.live(1.0, 0)
    settings = ZenohSettings.model_validate({"role": role, "connect": [endpoint], **more})
    return Node(settings, P, states, ROOT / "stage.toml", align=clock.align, due=lambda: clock.deadline_ns), states


def conduct(pipe: Connection, endpoint: str, names: list[str], hz: float) -> None:
    """A conductor's process: says when it conducts, and at the end what it published."""
    clock = Clock(hz)
    node, states = make_node(endpoint, "conductor", names, clock)
    pipe.send("ready")
    begin, spent = 0.0, {"layers": 0.0, "publish": 0.0}
    rested = dict.fromkeys(names, 0.0)
    shown = {name: P.neutral() for name in names}
    for now in clock.run(lambda: not pipe.poll()):
        if not begin and node.lease.active:
            begin, began_s = time.process_time(), time.monotonic()
            pipe.send("conducting")
        for name, state in states.items():
            first, stamp, values = time.thread_time(), 0, shown[name]
            rested[name] += clock.step_s
            if not node.rests(name):
                stamp, rested[name] = state.tick(now, rested[name], values), 0.0
            second = time.thread_time()
            node.relay(name, now, clock.step_s, values, stamp)
            spent["layers"] += second - first
            spent["publish"] += time.thread_time() - second
    pipe.recv()
    report = {
        "ticks": clock.ticks * len(states), "published": node.published, "skipped": clock.skipped,
        "seconds": time.monotonic() - began_s, "processor_s": time.process_time() - begin, **spent,
    }  # fmt: skip
    node.close()
    pipe.send(report)


def follow(pipe: Connection, endpoint: str, names: list[str], hz: float) -> None:
    """A process with heads: what arrived between ``begin`` and the end."""
    clock = Clock(hz)
    node, states = make_node(endpoint, "head", names, clock)
    ages: list[float] = []
    sequences: dict[str, list[tuple[Token, int]]] = {name: [] for name in names}
    arrivals: list[tuple[float, Token]] = []
    for name, follower in node.followers.items():
        follower.take = _noting(follower.take, ages, sequences[name], arrivals if name == names[0] else [])  # type: ignore[method-assign]
    pipe.send("ready")
    values, begin = P.neutral(), 0.0
    order = ""
    while order != "end":
        for now in clock.run(lambda: not pipe.poll()):
            for name, state in states.items():
                stamp = 0 if node.rests(name) else state.tick(now, clock.step_s, values)
                node.relay(name, now, clock.step_s, values, stamp)
        order = pipe.recv()
        if order == "begin":
            begin = time.process_time()
            ages.clear()
            for found in sequences.values():
                found.clear()
        elif order == "report":
            pipe.send({"ages": ages.copy(), "sequences": {n: [*s] for n, s in sequences.items()},
                       "processor_s": time.process_time() - begin})  # fmt: skip
    gaps = [after[0] - before[0] for before, after in pairwise(arrivals) if after[1] != before[1]]
    pipe.send(gaps)
    node.close()


def _noting(
    take: Callable[[Header, Any], bool],
    ages: list[float],
    sequences: list[tuple[Token, int]],
    arrivals: list[tuple[float, Token]],
) -> Callable[[Header, Any], bool]:
    def noting(header: Header, values: Any) -> bool:
        now = time.monotonic_ns()
        taken = take(header, values)
        if taken:
            ages.append((now - header.time_ns) / 1e6)
            sequences.append((header.token, header.sequence))
            arrivals.append((now * 1e-9, header.token))
        return taken

    return noting


def start(target: Callable[..., None], *arguments: object) -> tuple[Any, Connection]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=target, args=(theirs, *arguments), daemon=True)
    process.start()
    assert ours.recv() == "ready"
    return process, ours


def loopback_bytes() -> int:
    """Bytes that went through this machine's loopback so far, of all programs."""
    line = next(line for line in Path("/proc/net/dev").read_text().splitlines() if line.strip().startswith("lo:"))
    return int(line.split(":")[1].split()[8])


def measure(heads: int, hz: float, seconds: float, processes: int) -> dict[str, Any]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    names = [f"h{i:05d}" for i in range(heads)]
    _, hub = start(route, endpoint)
    first, one = start(conduct, endpoint, names, hz)
    assert one.recv() == "conducting"
    _, two = start(conduct, endpoint, names, hz)
    followers = [start(follow, endpoint, names[i::processes], hz)[1] for i in range(processes)]
    time.sleep(2.0)
    for pipe in followers:
        pipe.send("begin")
    sent_bytes = loopback_bytes()
    time.sleep(seconds)
    sent_bytes = loopback_bytes() - sent_bytes
    reports = []
    for pipe in followers:
        pipe.send("report")
        reports.append(pipe.recv())
    os.kill(first.pid, signal.SIGKILL)
    time.sleep(2.0)
    gaps = []
    for pipe in followers:
        pipe.send("end")
        gaps += pipe.recv()
    two.send("end")
    two.recv()  # that it conducts
    standby = two.recv()
    hub.send("end")
    return summary(reports, gaps, standby, hub.recv(), sent_bytes, seconds)


def faces_sent(taken: list[tuple[Token, int]]) -> int:
    """How many faces of one head its conductors sent from the first to the last that it took of each; each conductor
    counts its own, in each of its terms.

    taken : tokens and sequences in the order in which they were taken.
    """
    ends: dict[Token, tuple[int, int]] = {}
    for token, sequence in taken:
        ends[token] = ends.get(token, (sequence, 0))[0], sequence
    return sum(last - first + 1 for first, last in ends.values())


def summary(
    reports: list[Any], gaps: list[float], standby: dict[str, Any], router_s: float, sent: int, seconds: float
) -> dict[str, Any]:
    ages = np.concatenate([report["ages"] for report in reports])
    lists = [found for report in reports for found in report["sequences"].values()]
    wanted = sum(map(faces_sent, lists))
    count = sum(map(len, lists))
    return {
        "faces a second": count / seconds,
        "delivered %": 100.0 * count / wanted,
        "age p50, p99, max (ms)": np.percentile(ages, [50, 99, 100]).round(2).tolist(),
        "processor of a head's process, us a face": 1e6 * sum(r["processor_s"] for r in reports) / count,
        "conductor: layers, us a face": 1e6 * standby["layers"] / standby["ticks"],
        "conductor: sending or following, us a face": 1e6 * standby["publish"] / standby["ticks"],
        "router, us a face": 1e6 * router_s / count,
        "loopback bytes a face, both hops": sent / count,
        "wait for the standby (ms)": [round(gap * 1e3) for gap in gaps],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--heads", type=int, default=50)
    parser.add_argument("--hz", type=float, default=50.0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    found = measure(options.heads, options.hz, options.seconds, options.processes)
    table = Table("measured", "value", title=f"{options.heads} heads at {options.hz:g} Hz", title_justify="left")
    for name, value in found.items():
        table.add_row(name, f"{value:.2f}" if isinstance(value, float) else str(value))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
