"""What formats and links cost: messages and values a second that one core decodes and encodes, and a flood on a link.

Run ``python benchmarks/links.py [--seconds S]``. Rows of formats are measured in turns, so that what else the machine
does falls on all of them; times are those of the processor. Then Live Link datagrams flood a link: how much processor
time it spends on them, and how old the face is that it shows. At last the 24 simulated servos of ``head24`` are driven
with and without 1,000 messages a second that come in, in turns: the jitter of their loop.
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS, Format
from controller.formats.frame import Frame
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import open_links, read_link
from controller.tools.stage_run import StageRun

ROUNDS = 5
FLOOD_HZ = 13_000
LOAD_HZ, JITTER_TURNS = 1000.0, 2


def faces(count: int) -> list[Frame]:
    """Faces in which every parameter has some value."""
    rng = np.random.default_rng(1)
    values = rng.uniform(P.low, P.high, (count, len(P)))
    return [Frame(each, np.ones(len(P), dtype=bool), n / 60) for n, each in enumerate(values)]


def rate(do: Callable[[], int], seconds: float) -> float:
    """How many a second of processor time, by calling ``do``, which says how many it did."""
    done, begin_s = 0, time.thread_time()
    while (spent_s := time.thread_time() - begin_s) < seconds:
        done += do()
    return done / spent_s


def codec(form: Format, sent: list[Frame]) -> tuple[Callable[[], int], Callable[[], int]]:
    """Decoding and encoding of some faces."""
    encoder, decoder = form.encoder(P), form.decoder(P)
    messages = [message for frame in sent for message in encoder.encode(frame)]

    def decode() -> int:
        return sum(len(decoder.feed(message)) for message in messages)

    def encode() -> int:
        return len([encoder.encode(frame) for frame in sent])

    return decode, encode


def measure(seconds: float) -> Table:
    """Every format in turns."""
    sent, table = faces(20), Table("format", "frames decoded/s", "values decoded/s", "frames encoded/s")
    kinds = FORMATS.kinds()
    work = {kind: codec(FORMATS.get(kind), sent) for kind in kinds}
    found: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
    for _ in range(ROUNDS):
        for kind, (decode, encode) in work.items():
            found[kind].append((rate(decode, seconds), rate(encode, seconds)))
    for kind, rates in found.items():
        decoded, encoded = np.median(rates, axis=0)
        values = int(FORMATS.get(kind).carries(P).sum())
        table.add_row(kind, f"{decoded:,.0f}", f"{decoded * values:,.0f}", f"{encoded:,.0f}")
    return table


def flood(seconds: float, rate_hz: float = FLOOD_HZ) -> str:
    """Datagrams at a rate to a link, and what it spends on them."""
    with ExitStack() as closers:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        receiver.bind(("127.0.0.1", 0))
        port = receiver.getsockname()[1]
        receiver.close()
        state, before = CommandState(P), {thread.ident for thread in threading.enumerate()}
        choice = read_link({"kind": "livelink", "listen": f"127.0.0.1:{port}"})
        (link,) = open_links([choice], LinkContext(state, closers))
        (thread,) = (each for each in threading.enumerate() if each.ident not in before)
        clock = time.pthread_getcpuclockid(thread.ident or 0)
        sender = closers.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        messages = [m for frame in faces(100) for m in FORMATS.get("livelink").encoder(P).encode(frame)]
        begin_s, spent_s, count = time.monotonic(), time.clock_gettime(clock), 0
        while (passed_s := time.monotonic() - begin_s) < seconds:
            while count < passed_s * rate_hz:
                sender.sendto(messages[count % 100], ("127.0.0.1", port))
                count += 1
            time.sleep(0.001)
        spent_s = time.clock_gettime(clock) - spent_s
        report = link.report()
        return (
            f"a flood of {count / passed_s:,.0f} datagrams/s costs the link {100 * spent_s / passed_s:.0f} % "
            f"of a core; the face is {1e3 * float(str(report['age_s'])):.1f} ms old"
        )


STAGE = """name = "loaded"
robots = ["head24"]
[[links]]
kind = "livelink"
listen = "127.0.0.1:{port}"
"""


def jitter(seconds: float, rate_hz: float) -> dict[str, float]:
    """Jitter (ms) of the loop of 24 servos while messages come at a rate: p50, p95, p99, max."""
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        free.close()
        path = Path(folder) / "loaded.toml"
        path.write_text(STAGE.format(port=port), encoding="utf-8")
        sender = subprocess.Popen([sys.executable, __file__, "--send", str(port), str(rate_hz)])
        try:
            report = StageRun(str(path)).run_without_face(seconds)
        finally:
            sender.kill()
            sender.wait()
    (bus,), (link,) = report["buses"], report["links"]
    if rate_hz and not link["accepted"]:
        raise RuntimeError("no message came in")
    return dict(bus["jitter_ms"])


def send(port: int, rate_hz: float) -> None:
    """Send faces at a rate until this process is ended."""
    messages = [m for frame in faces(100) for m in FORMATS.get("livelink").encoder(P).encode(frame)]
    begin_s, count = time.monotonic(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while True:
            while count < (time.monotonic() - begin_s) * rate_hz:
                sender.sendto(messages[count % 100], ("127.0.0.1", port))
                count += 1
            time.sleep(0.001)


def jitter_table(seconds: float) -> Table:
    """The loop's jitter without and with messages, in turns."""
    table = Table("messages/s", "turn", "p50 ms", "p95 ms", "p99 ms", "max ms", title="jitter of the loop of 24 servos")
    for turn in range(1, JITTER_TURNS + 1):
        for rate_hz in (0.0, LOAD_HZ):
            found = jitter(seconds, rate_hz)
            table.add_row(f"{rate_hz:,.0f}", str(turn), *(f"{found[key]:.3f}" for key in ("p50", "p95", "p99", "max")))
    return table


def main() -> None:
    """Print the tables and the flood."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=0.1, help="processor time of each measurement")
    parser.add_argument(
        "--jitter-seconds", type=float, default=10.0, help="of each turn of the servos; 0 leaves it out"
    )
    parser.add_argument("--send", nargs=2, type=float, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.send is not None:
        send(int(given.send[0]), given.send[1])
    console = Console()
    console.print(measure(given.seconds))
    console.print(flood(max(2.0, given.seconds)))
    if given.jitter_seconds:
        console.print(jitter_table(given.jitter_seconds))


if __name__ == "__main__":
    main()
