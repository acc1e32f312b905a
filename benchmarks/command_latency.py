"""Time from a command's arrival to the first goals that show it, of 24 servos, seen from outside of the program.

Run ``python benchmarks/command_latency.py [--seconds 60] [--face]``. The whole program runs between two
pseudo-terminals. On one, commands arrive at random phases. On the other this program stands between the port of the
servos and a simulated bus whose bytes take their time at 1 Mbaud: it passes the bytes on and notes when the first byte
of goals comes that move a lid whose command was just sent. The program's own figure stands beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import random
import selectors
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
import tty
from contextlib import suppress
from pathlib import Path

import numpy as np
import tomli_w
from rich.console import Console

from controller.base.paths import find_config
from drivers.base.children import environment
from drivers.sim import SimulatedBus

REACH_MS = {False: 12.0, True: 14.0}
"""The most that 99 of 100 commands may take, without and with a face."""
PERIOD_S = 0.3
"""Mean time between two commands to one lid, which has come to rest by then."""
HEADER = b"\xff\xff\xfd\x00\xfe"
SYNC_WRITE = 0x83
LIDS = {"eyeBlinkLeft": 0.0, "eyeBlinkRight": 0.0}


class Tap:
    """Passes bytes between the program's port and a simulated bus, and notes when goals of servos change.

    port : path for the program. seen : (s, servo id) of every change, on the monotonic clock.
    """

    def __init__(self, bus_path: str) -> None:
        self._ours, theirs = pty.openpty()
        tty.setraw(self._ours)
        tty.setraw(theirs)
        self._theirs = theirs
        self.port = os.ttyname(theirs)
        self._bus = os.open(bus_path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._bus)
        self._goals: dict[int, bytes] = {}
        self.seen: list[tuple[float, int]] = []
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        with selectors.DefaultSelector() as wait:
            wait.register(self._ours, selectors.EVENT_READ, self._bus)
            wait.register(self._bus, selectors.EVENT_READ, self._ours)
            while True:
                for key, _ in wait.select():
                    now_s = time.monotonic()
                    data = os.read(key.fd, 65536)
                    os.write(key.data, data)
                    if key.fd == self._ours:
                        self._note(data, now_s)

    def _note(self, data: bytes, now_s: float) -> None:
        """Goals come as whole packets, each in one write of the program."""
        at = data.find(HEADER)
        while at >= 0:
            length = int.from_bytes(data[at + 5 : at + 7], "little")
            packet = data[at + 7 : at + 7 + length]
            if packet[:1] == bytes([SYNC_WRITE]):
                self._compare(packet[1:-2], now_s)
            at = data.find(HEADER, at + 7 + length)

    def _compare(self, parameters: bytes, now_s: float) -> None:
        size = int.from_bytes(parameters[2:4], "little")
        for begin in range(4, len(parameters), 1 + size):
            servo, goal = parameters[begin], parameters[begin + 1 : begin + 1 + size]
            if self._goals.get(servo) != goal:
                self._goals[servo] = goal
                self.seen.append((now_s, servo))


def write_stage(folder: Path, command_port: str, servo_port: str) -> tuple[Path, dict[str, int]]:
    """A stage of head24 on these ports; also the servo that each parameter of LIDS moves."""
    settings = tomllib.loads(find_config("robots", "head24").read_text(encoding="utf-8"))
    settings["buses"][0] |= {"kind": "dynamixel", "port": servo_port}
    (folder / "robot.toml").write_text(tomli_w.dumps(settings), encoding="utf-8")
    links = [{"kind": "line", "port": command_port}]
    stage = {"name": "latency", "head": "ict", "robots": [str(folder / "robot.toml")], "links": links}
    (folder / "stage.toml").write_text(tomli_w.dumps(stage), encoding="utf-8")
    moved = {name: next(c["id"] for c in settings["channels"] if c["mix"].get(name) == 1.0) for name in LIDS}
    return folder / "stage.toml", moved


def send(port: int, seconds: float, seed: int) -> list[tuple[float, str]]:
    """Close and open the lids in turn at random moments; (s, parameter) of each command."""
    draw, sent = random.Random(seed), list[tuple[float, str]]()
    values, end_s = dict(LIDS), time.monotonic() + seconds
    while time.monotonic() < end_s:
        for name in LIDS:
            time.sleep(PERIOD_S / len(LIDS) * draw.uniform(0.8, 1.2))
            values[name] = 0.7 - values[name]
            sent.append((time.monotonic(), name))
            os.write(port, f"SET {name} {values[name]}\n".encode())
            os.set_blocking(port, False)
            with suppress(BlockingIOError):
                os.read(port, 65536)  # the answers before
    return sent


def delays_ms(sent: list[tuple[float, str]], seen: list[tuple[float, int]], moved: dict[str, int]) -> np.ndarray:
    """From each command to the first change of its servo's goal after it."""
    found = []
    for at_s, name in sent:
        later = [s for s, servo in seen if servo == moved[name] and s > at_s]
        found.append((min(later, default=np.inf) - at_s) * 1e3)
    return np.array(found)


def main() -> int:
    """Run the program, send commands, report; exit code 1 where the reach is missed."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="how long commands are sent (default 60)")
    parser.add_argument("--face", action="store_true", help="draw the face meanwhile")
    parser.add_argument("--seed", type=int, default=1, help="of the moments (default 1)")
    given = parser.parse_args()
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    with tempfile.TemporaryDirectory(prefix="omote-") as name:
        folder = Path(name)
        with SimulatedBus(range(1, 25), link=folder / "servos", wire=True, process=True):
            tap = Tap(str(folder / "servos"))
            stage, moved = write_stage(folder, os.ttyname(theirs), tap.port)
            report = folder / "report.json"
            words = ["run", str(stage), "--headless", "--seconds", str(given.seconds + 12), "--report", str(report)]
            words += [] if given.face else ["--no-face"]
            program = subprocess.Popen(
                [sys.executable, "-P", "-c", "from controller.cli.app import main; main()", *words],
                stdout=subprocess.DEVNULL,
                env=environment("controller"),
            )
            while len(tap.seen) < 24 and program.poll() is None:
                time.sleep(0.1)
            time.sleep(5.0)
            sent = send(ours, given.seconds, given.seed)
            program.wait(60.0)
            found = json.loads(report.read_text(encoding="utf-8"))
    return show(delays_ms(sent, tap.seen, moved), found, given.face)


def show(delays: np.ndarray, report: dict, face: bool) -> int:
    """Print the figures."""
    console, bus = Console(), report["buses"][0]
    own, reach = bus["command_to_wire_ms"], REACH_MS[face]
    p50, p95, p99 = np.percentile(delays, [50, 95, 99])
    console.print(f"{len(delays)} commands, {'with' if face else 'without'} a face, bus at {bus['wanted_hz']:g} Hz")
    console.print(f"outside: p50 {p50:.2f} ms, p95 {p95:.2f} ms, p99 {p99:.2f} ms (reach {reach:g} ms)")
    console.print(f"own:     p50 {own['p50']:.2f} ms, p95 {own['p95']:.2f} ms, p99 {own['p99']:.2f} ms")
    console.print(f"bus tick off its deadline p99 {bus['jitter_ms']['p99']:.2f} ms, {bus['skipped']} skipped")
    return int(p99 > reach)


if __name__ == "__main__":
    sys.exit(main())
