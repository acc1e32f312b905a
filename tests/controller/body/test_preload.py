"""controller.body.preload"""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS
from controller.body import preload as module
from controller.body.messages import BodyOrders, Failed, RunOptions
from controller.body.preload import PreloadedBody
from controller.body.process import BodyProcess
from controller.body.sources import Voice
from controller.stage.stage import load_stage


def test_it_ends_with_the_block_where_nobody_has_orders() -> None:
    with pytest.raises(RuntimeError, match="no such stage"), PreloadedBody() as waiting:
        raise RuntimeError("no such stage")
    assert waiting.process.exitcode is not None
    assert waiting.pipe.closed and waiting.voice.closed


@pytest.mark.slow
def test_it_does_as_it_is_told_and_is_left_alone_then() -> None:
    with PreloadedBody() as waiting:
        waiting.send(BodyOrders("no such stage"))
    assert not waiting.pipe.closed
    assert waiting.pipe.poll(30.0)
    answer = waiting.pipe.recv()
    assert isinstance(answer, Failed) and "no such stage" in answer.message
    waiting.process.join(30.0)
    assert waiting.process.exitcode == 0
    waiting.pipe.close()
    waiting.voice.close()


def test_a_process_that_does_not_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_END_S", 0.001)
    with PreloadedBody() as waiting:
        monkeypatch.setattr(waiting.process, "terminate", lambda: None)  # the signal is lost
        os.kill(waiting.process.pid or 0, signal.SIGSTOP)  # nor does it notice that its pipe has ended
    waiting.process.join(60.0)
    assert waiting.process.exitcode == -signal.SIGKILL


@pytest.mark.slow
def test_it_ends_when_main_is_gone() -> None:
    program = """
import os
from controller.body.preload import PreloadedBody
if __name__ == "__main__":
    print(PreloadedBody().process.pid, flush=True)  # os._exit writes nothing out
    os._exit(0)
"""
    main = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=120)
    assert main.returncode == 0 and int(main.stdout) > 0  # its standard output closes when both have ended


def test_it_ends_where_the_voice_cannot_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    stage = load_stage("everything", PARAMETERS)
    with pytest.raises(TakeError, match="standard input is closed"), PreloadedBody() as waiting:
        BodyProcess(stage, PARAMETERS, RunOptions(voice=Voice("-")), preloaded=waiting)
    assert waiting.process.exitcode is not None


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux which signals a process holds back")
def test_an_interrupt_waits_from_the_first_moment_of_the_first_process_on() -> None:
    program = """
from pathlib import Path
from controller.body.preload import PreloadedBody
if __name__ == "__main__":
    with PreloadedBody() as waiting:
        print(Path(f"/proc/{waiting.process.pid}/status").read_text())
"""
    said = subprocess.check_output([sys.executable, "-c", program], text=True, timeout=120)
    held = next(int(line.split()[1], 16) for line in said.splitlines() if line.startswith("SigBlk"))
    assert all(held >> number - 1 & 1 for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="starts processes as Linux does")
def test_a_program_that_is_ended_while_it_starts_the_process_leaves_none_that_complains() -> None:
    program = """
import os, signal
from multiprocessing import util
from controller.body.preload import PreloadedBody
start = util.spawnv_passfds
def start_and_end(*given):
    pid = start(*given)
    if given[1][-1] == "--multiprocessing-fork":
        os.kill(os.getpid(), signal.SIGHUP)  # the process is there, and has not been told what to do
    return pid
util.spawnv_passfds = start_and_end
if __name__ == "__main__":
    PreloadedBody()
"""
    main = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert main.returncode == -signal.SIGHUP and not main.stderr


def test_the_command_line_comes_without_numpy() -> None:
    program = """
import sys, controller.body.preload
from controller.cli.app import make_app
make_app()
print("numpy" in sys.modules, "pydantic" in sys.modules)
"""
    assert subprocess.check_output([sys.executable, "-c", program], text=True).split() == ["False", "False"]
