"""Random, damaged, binary and overlong lines of every command to a running stage: ``make fuzz``.

The body runs in its own process, with a link on a pseudo-terminal, idle motion, a show, a voice and 24 simulated
servos. Rounds of lines end with a probe, a PING with a tag and a checksum, which must be answered. Bounded by
``--count`` lines; the same seed sends the same lines.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS
from controller.body.messages import RunOptions
from controller.body.process import BodyProcess
from controller.body.sources import Voice
from controller.links.line.hostport import HostPort
from controller.links.line.protocol import MAX_REPLY, LineDecoder, LineError, format_words, parse_reply
from controller.stage.stage import Stage, load_stage
from drivers.sim import SimulatedBus
from tests.fuzz.line_corpus import Lines

ROOT = Path(__file__).resolve().parents[2]
ANSWER_S = 10.0
FIRST_TAG = 100_000_000
VOICE_HZ = 8000
TICKS_A_DEGREE = 4096 / 360
GROWTH_MB = 20.0
WARM_SHARE = 0.3

SHOW = """
loop_s = 2.0
marks = { middle = 1.0 }
steps = ["0 EXPR smile 1 0.05", "0.1 NEUTRAL 0", "0.5 SET jawOpen 0.5", "1 SHOW SEEK 0.2", "1.5 EXPR wink 1 0.05"]
"""


@dataclass
class Findings:
    """What a run showed; ``faults`` : what must not be, each kind with its count."""

    lines: int = 0
    probes: int = 0
    lost: int = 0
    seconds: float = 0.0
    growth_mb: float = 0.0
    answer_ms: list[float] = field(default_factory=list)
    faults: Counter[str] = field(default_factory=Counter)
    report: dict[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        ms = np.percentile(self.answer_ms or [np.nan], (50, 99, 100))
        return (
            f"{self.lines} lines in {self.seconds:.0f} s, {self.probes} probes answered, {self.lost} after "
            f"their answer was counted as unanswered; answer to a valid line in "
            f"garbage p50 {ms[0]:.1f} ms, p99 {ms[1]:.1f} ms, at most {ms[2]:.1f} ms; memory grew by "
            f"{self.growth_mb:.1f} MB; faults: {dict(self.faults) or 'none'}"
        )


def write_stage(folder: Path, port: str, wire: str) -> Stage:
    """The shipped head with 24 servos on a wire, commanded over a port, with idle motion and a show that loops."""
    robot = (ROOT / "configs/robots/head24.toml").read_text(encoding="utf-8")
    robot = robot.replace('kind = "simulated"', f'kind = "dynamixel"\nport = "{wire}"\nmargin_s = 0.5')
    (folder / "robot.toml").write_text(robot)
    (folder / "fuzz.toml").write_text(SHOW)
    link = f'[[links]]\nport = "{port}"\nchecksum = "optional"\n'
    (folder / "stage.toml").write_text(
        f'name = "fuzz"\nrobots = ["robot.toml"]\nshow = "fuzz.toml"\nliveliness = 1.0\n{link}'
    )
    return load_stage(str(folder / "stage.toml"), PARAMETERS)


class Speaker:
    """Writes a voice, noise at its own rate, to a named pipe until closed."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self.path = path
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the stream."""
        self._ended.set()
        with suppress(OSError):
            os.close(os.open(self.path, os.O_RDONLY | os.O_NONBLOCK))  # lets the writer go that waits for a reader
        self._thread.join()

    def _run(self) -> None:
        noise = np.random.default_rng(1).integers(-9000, 9000, VOICE_HZ // 20).astype("<i2").tobytes()
        with suppress(OSError), self.path.open("wb", buffering=0) as stream:
            while not self._ended.wait(0.05):
                stream.write(noise)


class Run:
    """Sends rounds of lines to the body of a stage and watches it."""

    def __init__(self, folder: Path, seed: int, closers: ExitStack) -> None:
        self.findings = Findings()
        self._lines, self._draw = Lines(seed), random.Random(seed)
        self._servos = closers.enter_context(SimulatedBus(range(1, 25)))
        self._port = closers.enter_context(HostPort())
        self._decoder = LineDecoder(MAX_REPLY)
        self._tag, self._answered = FIRST_TAG, False
        self._values = np.zeros(len(PARAMETERS))
        stage = write_stage(folder, self._port.path, self._servos.path)
        self._limits = {
            channel.id: max(map(abs, channel.limit_deg)) * TICKS_A_DEGREE + 2 for channel in stage.robots[0].channels
        }
        speaker = Speaker(folder / "voice")
        closers.callback(speaker.close)
        voice = Voice(str(speaker.path), VOICE_HZ)
        self._body = closers.enter_context(BodyProcess(stage, PARAMETERS, RunOptions(voice=voice)))
        self._body.wait_ready()
        self._body.begin()
        self._greet()

    def _greet(self) -> None:
        """Wait until the link is open: what arrives before is discarded."""
        end = time.monotonic() + ANSWER_S
        while time.monotonic() < end and not self._decoder.feed(self._port.read(0.1)):
            self._port.write(b"HELLO\n")

    def run(self, count: int) -> Findings:
        """Send at least ``count`` lines, fewer where the body dies or hangs."""
        found, start_s, warm_mb = self.findings, time.monotonic(), 0.0
        try:
            while found.lines < count and not found.faults["hangs"]:
                self._round()
                if not warm_mb and found.lines >= WARM_SHARE * count:
                    warm_mb = self._memory_mb()
            found.growth_mb = self._memory_mb() - (warm_mb or self._memory_mb())
            if found.growth_mb > GROWTH_MB:
                found.faults["memory grew"] += 1
            self._body.stop()
        except ControllerError as error:
            found.faults[f"the body ended: {error}"] += 1
        found.seconds, found.report = time.monotonic() - start_s, self._body.report
        self._judge(found)
        return found

    def _judge(self, found: Findings) -> None:
        """Faults that the body's own report names."""
        for link in found.report.get("links", []):  # type: ignore[attr-defined]
            if found.lost > link["unanswered"] + self._port.dropped:
                found.faults["probes neither answered nor counted"] += 1
            if link["faults"]:
                found.faults[f"errors of the link, the last one {link['last_fault']}"] += link["faults"]

    def _round(self) -> None:
        """Some lines and a probe, in writes of any size, and everything that must hold then."""
        some = [self._lines.any() for _ in range(self._draw.randint(1, 30))]
        lines = self._lines.flood() if self._draw.random() < 0.03 else some
        if self._draw.random() < 0.3:
            lines += [b"\nHELLO checksum=optional\n", b"START\n"]
        self._tag, self._answered = self._tag + 1, False
        data = b"".join(lines) + b"\n" + format_words(["PING"], tag=self._tag, checked=True)
        size = self._draw.choice((7, 64, 4096))
        sent_s = time.monotonic()
        for at in range(0, len(data), size):
            sent_s = time.monotonic()
            self._port.write(data[at : at + size])
            self._hear(0.0)  # whoever does not read while writing loses answers
        self.findings.lines += len(lines) + 1
        self._listen(sent_s)
        self._body.alive()
        self._check_limits()

    def _listen(self, sent_s: float, *, again: bool = False) -> None:
        """Read until the probe is answered; ``again`` : it was sent a second time."""
        while not self._answered and time.monotonic() - sent_s < ANSWER_S:
            self._hear(0.5)
            self._body.alive()
        if self._answered:
            self.findings.probes += 1
            self.findings.answer_ms.append((time.monotonic() - sent_s) * 1e3)
        elif again:
            self.findings.faults["hangs"] += 1
        else:  # the answer may be one of those that omote counts as unanswered
            self.findings.lost += 1
            self._port.write(format_words(["PING"], tag=self._tag, checked=True))
            self._listen(time.monotonic(), again=True)

    def _hear(self, wait_s: float) -> None:
        """Take what has arrived; waits for the first byte at most so long."""
        for line in self._decoder.feed(self._port.read(wait_s)):
            self._answered |= self._is_answer(line)

    def _is_answer(self, line: bytes) -> bool:
        try:
            reply = parse_reply(line)
        except LineError:
            self.findings.faults["answers that cannot be read"] += 1
            return False
        return reply is not None and reply.tag == self._tag and reply.ok

    def _check_limits(self) -> None:
        self._body.mailbox.read(self._values)
        inside = (self._values >= PARAMETERS.low - 1e-9) & (self._values <= PARAMETERS.high + 1e-9)
        self.findings.faults["parameters beyond their range"] += int(np.count_nonzero(~inside))
        if self._draw.random() < 0.05:
            far = sum(abs(self._servos.servo(i).goal - 2048) > limit for i, limit in self._limits.items())
            self.findings.faults["servos beyond their limits"] += far
        self.findings.faults += Counter()  # drops what is 0

    def _memory_mb(self) -> float:
        pages = int(Path(f"/proc/{self._body._process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def attack(count: int, seed: int) -> Findings:
    """A whole run, from the start of the stage to its end."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, ExitStack() as closers:
        return Run(Path(folder), seed, closers).run(count)


def main() -> int:
    """Run, print one paragraph; exit code 1 where there was any fault."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.lines", description=str(__doc__).splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000, help="lines (default 100000)")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    found = attack(given.count, given.seed)
    print(found)
    return int(bool(found.faults))


if __name__ == "__main__":
    sys.exit(main())
