"""The roles of a stage as processes of the command line: one stage file, and one conductor at a time."""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import sys
import time
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest

zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from tests.controller.fleet.nodes import router, until  # noqa: E402
from tests.controller.fleet.test_node import client  # noqa: E402

STAGE = """
name = "split"
liveliness = 1.0
robots = ["head24"]
[zenoh]
connect = ["{hub}"]
lease_ms = 400
[[heads]]
name = "maple"
[[heads]]
name = "oak"
"""


class Process:
    """``omote run`` in a role, until it is ended; then its report."""

    def __init__(self, folder: Path, name: str, *options: str) -> None:
        self.report_path, self._log = folder / f"{name}.json", (folder / f"{name}.log").open("w")
        program = [sys.executable, "-c", "import sys; from controller.cli import main; sys.exit(main())"]
        command = [*program, "run", str(folder / "stage.toml"), "--no-face"]
        command += ["--report", str(self.report_path), *options]
        self._process = subprocess.Popen(command, stdout=self._log, stderr=self._log, start_new_session=True)

    def children(self) -> list[int]:
        """The process ids of the program and of what it started."""
        found = Path(f"/proc/{self._process.pid}/task/{self._process.pid}/children").read_text().split()
        return [self._process.pid, *map(int, found)]

    def signal(self, which: int) -> None:
        for process in self.children():
            os.kill(process, which)

    def end(self) -> None:
        if self._process.poll() is None:
            self.signal(signal.SIGCONT)
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(30.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._log.close()

    def report(self) -> dict[str, object]:
        self.end()
        found: dict[str, object] = json.loads(self.report_path.read_text())
        return found


def replaced(process: Process, tokens: list[tuple[float, tuple[int, int]]]) -> bool:
    """Stop a process: whether another one conducts then; False where faces of the same one go on coming."""
    stopped, before = time.monotonic(), tokens[-1][1]
    process.signal(signal.SIGSTOP)
    until(lambda: tokens[-1][1] > before or tokens[-1][0] > stopped + 1.0)
    return tokens[-1][1] > before


@pytest.mark.slow
def test_a_stopped_conductor_is_replaced_and_does_not_come_back_while_servos_go_on(tmp_path: Path) -> None:
    with ExitStack() as stack:
        hub = stack.enter_context(router())
        (tmp_path / "stage.toml").write_text(STAGE.format(hub=hub))
        session = stack.enter_context(client(hub))
        tokens: list[tuple[float, tuple[int, int]]] = []
        session.declare_subscriber("omote/maple/parameters", lambda s: tokens.append(
            (time.monotonic(), struct.unpack_from("<QQ", s.attachment.to_bytes(), 4))
        ))  # fmt: skip

        def start(name: str, *options: str) -> Process:
            process = Process(tmp_path, name, *options)
            stack.callback(process.end)
            return process

        def ask(text: str) -> str:
            replies = session.get("omote/oak/commands", payload=text, timeout=2.0)
            return next((r.ok.payload.to_string() for r in replies if r.ok is not None), "")

        first = start("first", "--role", "conductor")
        until(lambda: tokens, 90.0)
        second = start("second", "--role", "conductor")
        head = start("head", "--role", "head", "--heads", "maple")
        until(lambda: ask("SET jawOpen 0.5") == "OK SET 1\n", 30.0)
        until(lambda: list(session.get("omote/maple/state/head", timeout=1.0)), 90.0)
        until(lambda: len(list(session.liveliness().get("omote/oak/alive/conductor/*", timeout=1.0))) == 2, 90.0)
        time.sleep(1.5)  # the second one has asked what was commanded
        stopped, before = time.monotonic(), tokens[-1][1]
        if not replaced(first, tokens):  # on a busy machine it had lost its lease to the other one
            first.signal(signal.SIGCONT)
            time.sleep(3.0)
            first, second = second, first
            stopped, before = time.monotonic(), tokens[-1][1]
            assert replaced(first, tokens)
        after = next(at for at, token in tokens if token > before)
        slow = max(b - a for (a, _), (b, _) in pairwise(tokens[-500:]) if not a <= after <= b)
        assert after - stopped < 1.0 + 3.0 * slow  # 0.5 s on an idle machine
        time.sleep(1.0)
        first.signal(signal.SIGCONT)
        time.sleep(2.0)
        late = {token for at, token in tokens if at > after + 0.5}
        assert ask("GET jawOpen").startswith("OK GET jawOpen=0.5")
        reports = {name: process.report() for name, process in (("head", head), ("first", first), ("second", second))}
    fences = [token for _, token in tokens]
    assert len(set(fences)) == 2 or max(late) > before
    assert reports["head"]["zenoh"]["role"] == "head"  # type: ignore[index]
    assert reports["head"]["buses"][0]["name"] == "maple/head"  # type: ignore[index]
    assert reports["first"]["buses"] == []  # who conducts drives no servos
    heads = reports["head"]["zenoh"]["heads"]  # type: ignore[index]
    assert list(heads) == ["maple"] and heads["maple"]["taken"] > 100
    one, two = (reports[name]["zenoh"] for name in ("first", "second"))
    assert two["terms"] >= 1  # type: ignore[index]
    if (two["terms"], two["lost"]) == (1, 0):  # type: ignore[index]  # a busy machine can cost the second its lease, too
        assert one["lost"] >= 1 and not one["conducting"]  # type: ignore[index]
