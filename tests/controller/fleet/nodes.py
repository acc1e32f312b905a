"""What tests of several nodes share: a free port, a router, nodes that tick in threads."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from controller.base.parameters import PARAMETERS as P
from controller.fleet.node import Node
from controller.layers.commands import CommandState
from controller.stage.zenoh import ZenohSettings

LEASE_MS = 200.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(condition: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.005)
    raise AssertionError("waited in vain")


@contextmanager
def router(config: dict[str, Any] | None = None, endpoint: str | None = None) -> Iterator[str]:
    """A router of the library itself; yields its endpoint."""
    import json

    endpoint = endpoint or f"tcp/127.0.0.1:{free_port()}"
    made = zenoh.Config()
    entries = {"mode": "router", "listen/endpoints": [endpoint], "scouting/multicast/enabled": False}
    for key, value in {**entries, **(config or {})}.items():
        made.insert_json5(key, json.dumps(value))
    with zenoh.open(made):
        yield endpoint


def joined(*runs: Running) -> Callable[[], bool]:
    """Whether every head of some nodes has been exactly a conductor's at any moment from now on.

    On a busy machine faces come so late that heads catch up again and again, and hardly all are exact at one time.
    """
    begins = [(run, name, len(run.exact[name])) for run in runs for name in run.exact]
    return lambda: all(any(run.exact[name][begin:]) for run, name, begin in begins)


class Running:
    """A node whose heads are ticked ``hz`` times a second in a thread, as a body does.

    journal : is told every tick and command of the layers.

    rows : for each head, what was shown, in order. times : when rows were written. paused : ticks nothing, as a stopped
    process. mixed : for each tick of each head, whether it showed exactly what a conductor sent, and whether its layers
    ticked. exact : for each row, whether it is exactly what a conductor sent.
    """

    def __init__(self, endpoint: str, role: str, *, folder: Path, seed: int = 1, heads: tuple[str, ...] = ("maple",),
                 hz: float = 100.0, journal: Callable[..., None] | None = None, **more: Any) -> None:  # fmt: skip
        self._step_ns, self._due_ns = round(1e9 / hz), time.monotonic_ns()
        settings = {"role": role, "connect": [endpoint], "lease_ms": LEASE_MS, **more}
        self.states = {name: CommandState(P, seed=seed + i) for i, name in enumerate(heads)}
        for state in self.states.values():
            state.record(journal)
            state.live(1.0, 0)
        validated = ZenohSettings.model_validate(settings)
        self.node = Node(validated, P, self.states, folder / "stage.toml", due=lambda: self._due_ns)
        self.rows: dict[str, list[np.ndarray]] = {name: [P.neutral()] for name in heads}
        self.times: list[int] = [0]
        self.mixed: dict[str, list[tuple[bool, bool]]] = {name: [] for name in heads}
        self.exact: dict[str, list[bool]] = {name: [False] for name in heads}
        self.paused, self._stopping = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self._due_ns, rested = time.monotonic_ns(), dict.fromkeys(self.states, 0.0)
        while not self._stopping.is_set():
            while self.paused.is_set() and not self._stopping.is_set():
                time.sleep(0.001)
            before_ns, self._due_ns = self._due_ns, max(self._due_ns + self._step_ns, time.monotonic_ns() - 50_000_000)
            time.sleep(max(0.0, 1e-9 * (self._due_ns - time.monotonic_ns())))
            now, step_s = time.monotonic_ns(), 1e-9 * (self._due_ns - before_ns)
            self.times.append(now)
            for name, state in self.states.items():
                values, stamp = self.rows[name][-1].copy(), 0
                rested[name] += step_s
                follower = self.node.followers[name]
                follows, rests = follower.conducted, self.node.rests(name)
                self.mixed[name].append((follows, not rests))
                if not rests:
                    stamp, rested[name] = state.tick(now, rested[name], values), 0.0
                self.node.relay(name, now, step_s, values, stamp)
                self.rows[name].append(values)
                self.exact[name].append(follower.exact and follower.conducted)  # not who shows exactly its own life

    def stop(self) -> None:
        """Tick no more."""
        self._stopping.set()
        self._thread.join()

    def __enter__(self) -> Running:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self.node.close()
