"""Simulates a robot host, which sends a script over a pseudo-terminal and counts the answers.

``python -m controller.links.line.host --script tour`` makes the port, prints ``ready PATH``, serves until its standard
input ends, and prints its counts as one line of JSON. So it ends with the process that started it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
import select
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from controller.base.clock import Samples
from controller.base.errors import OMOTE_ERRORS
from controller.base.parameters import PARAMETERS, Parameters
from controller.base.signals import TERMINATION_SIGNALS
from controller.links.line.hostport import HostPort
from controller.links.line.protocol import MAX_REPLY, LineDecoder, LineError, Reply, format_words, number, parse_reply
from controller.links.line.script import Script, Wave, load_script
from controller.vocabulary.vocabulary import Vocabulary

_ANSWER_TIMEOUT_S = 1.0
_GREETING = "HELLO"
_GREETING_INTERVAL_S = 0.1
_POLL_INTERVAL_S = 0.02
_MAX_REFUSALS = 20  # refusals that the report shows
_NO_STEP = (math.inf, "")


class RobotHost:
    """Plays a script to the program that opens the port.

    Parameters
    ----------
    port : the host's end. script : the lines to send. parameters : for lines with every parameter.
    now_s : the time source (s).

    Attributes
    ----------
    counts : numbers of lines: sent, accepted, refused, unanswered, damaged, unasked, streamed.
    refusals : the first refused lines with their answers. round_trip_ms : times from a line to its answer.
    """

    def __init__(
        self, port: HostPort, script: Script, parameters: Parameters, *, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.port = port
        self.script = script
        self.refusals: list[str] = []
        self.round_trip_ms = Samples(8192)
        self.counts: Counter[str] = Counter()
        self._wave = Wave(parameters)
        self._decoder = LineDecoder(MAX_REPLY)
        self._waiting: dict[int, tuple[float, str]] = {}
        self._tag = 0
        self._now_s = now_s
        self._greeted = False

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Send greetings until there is an answer, then play the script, while ``keep_going()`` returns True."""
        while keep_going() and not self._greeted:
            self.send(_GREETING)
            self._listen(self._now_s() + _GREETING_INTERVAL_S)
        start_s, frame, steps = self._now_s(), 0, self._steps()
        step_s, line = next(steps, _NO_STEP)
        while keep_going():
            at_s = self._now_s() - start_s
            while step_s <= at_s and keep_going():
                self.send(line)
                step_s, line = next(steps, _NO_STEP)
            frame = self._send_frame(frame, at_s)
            frame_s = frame / self.script.frames_hz if self.script.frames_hz else math.inf
            self._listen(start_s + min(at_s + _POLL_INTERVAL_S, step_s, frame_s))

    def _steps(self) -> Iterator[tuple[float, str]]:
        """Yield times since the start (s) and lines; endlessly if the script loops."""
        yield from self.script.steps
        if self.script.loop_s and self.script.steps:
            for rounds in itertools.count(1):
                for at_s, line in self.script.steps:
                    yield rounds * self.script.loop_s + at_s, line

    def send(self, line: str) -> int:
        """Send a line with a tag and a checksum, and return the tag."""
        self._tag = self._tag % 999_999_999 + 1
        self._waiting[self._tag] = (self._now_s(), line)
        self.counts["sent"] += 1
        self.port.write(format_words([line], tag=self._tag, checked=True))
        return self._tag

    def report(self) -> dict[str, object]:
        """Return the counts, the first refusals and the round-trip times."""
        kinds = ("sent", "accepted", "refused", "unanswered", "damaged", "unasked", "streamed")
        return {
            "script": self.script.name,
            **{kind: self.counts[kind] for kind in kinds},
            "dropped_bytes": self.port.dropped,
            "refusals": self.refusals,
            "round_trip_ms": self.round_trip_ms.summary(),
        }

    def _send_frame(self, frame: int, at_s: float) -> int:
        """Send every parameter if a frame is due, and return the number of the next one; missed frames are skipped."""
        due = int(at_s * self.script.frames_hz) + 1
        if self.script.frames_hz and frame < due:
            self.send("FRAME " + " ".join(map(number, self._wave.at(at_s).tolist())))
            return due
        return frame

    def _listen(self, until_s: float) -> None:
        while True:
            data = self.port.read(until_s - self._now_s())
            for line in self._decoder.feed(data):
                self._take(line)
            if self._now_s() >= until_s:
                break
        self._forget(self._now_s() - _ANSWER_TIMEOUT_S)

    def _take(self, line: bytes) -> None:
        try:
            reply = parse_reply(line)
        except LineError:
            self.counts["damaged"] += 1
            return
        if reply is None:
            return
        if reply.kind in ("P", "F"):
            self.counts["streamed"] += 1
            return
        self._count_answer(reply)

    def _count_answer(self, reply: Reply) -> None:
        asked = self._waiting.pop(reply.tag or 0, None)
        if asked is None:
            self.counts["unasked"] += 1
            return
        self._greeted = True
        self.round_trip_ms.add((self._now_s() - asked[0]) * 1e3)
        self.counts["accepted" if reply.ok else "refused"] += 1
        if not reply.ok and len(self.refusals) < _MAX_REFUSALS:
            self.refusals.append(f"{asked[1]} -> ERR {reply.code} {reply.text}")

    def _forget(self, before_s: float) -> None:
        for tag in [tag for tag, (sent_s, _) in self._waiting.items() if sent_s < before_s]:
            _, line = self._waiting.pop(tag)
            self.counts["unanswered"] += line != _GREETING  # one answered greeting is enough


def main(arguments: list[str] | None = None) -> int:
    """Serve a script in a separate process; see the module's docstring."""
    parser = argparse.ArgumentParser(prog="controller.links.line.host", description="simulated robot host")
    parser.add_argument("--script", default="tour", help="a path, or a name in configs/scripts")
    parser.add_argument("--vocabulary", type=Path, action="append", default=[], help="file of further expressions")
    parser.add_argument("--link", type=Path, default=None, help="make this path a link to the port")
    options = parser.parse_args(arguments)
    for ending in (signal.SIGINT, *TERMINATION_SIGNALS):  # they reach the process group, but only stdin ends this one
        signal.signal(ending, signal.SIG_IGN)
    try:
        parameters = PARAMETERS.with_files(options.vocabulary)
        script = load_script(options.script, parameters, Vocabulary.load(parameters, more=options.vocabulary))
        with HostPort(options.link) as port:
            _print_line(f"ready {port.path}")
            host = RobotHost(port, script, parameters)
            host.run(_stdin_open)
            _print_line(json.dumps(host.report()))
    except OMOTE_ERRORS as error:
        _print_line("failed " + json.dumps([str(error), error.hint]))
        return 1
    return 0


def _print_line(line: str) -> None:
    try:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        pass  # the process that started it has ended


def _stdin_open() -> bool:
    """False once standard input has ended, which happens when the parent process closes it or ends."""
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return not ready or bool(os.read(sys.stdin.fileno(), 1024))


if __name__ == "__main__":
    sys.exit(main())
