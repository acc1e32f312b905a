"""Opening a line link, with a simulated host in a process of its own."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from controller.base.errors import ConfigError, LinkError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.line import opening
from controller.links.line.hostport import HostPort
from controller.links.line.kind import LineSettings
from controller.links.line.opening import HostProcess, open_line
from drivers.base.errors import PortMissing


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets a host start and end slowly: on a busy machine it may be scheduled late, or wait for compiled kernels."""
    monkeypatch.setattr(opening, "_START_TIMEOUT_S", 120.0)
    monkeypatch.setattr(opening, "_END_TIMEOUT_S", 60.0)


def eventually(question: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not question():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_a_real_port_is_opened_and_closed_with_the_context() -> None:
    with HostPort() as port:
        with ExitStack() as closers:
            link = open_line(LineSettings(port=port.path, baud=9600), LinkContext(CommandState(P), closers))
            assert link.connected and link.port == port.path
        assert not link.connected


def test_the_stage_chooses_when_checksums_are_demanded() -> None:
    with HostPort() as port, ExitStack() as closers:
        open_line(LineSettings(port=port.path, checksum="required"), LinkContext(CommandState(P), closers))
        port.write(b"PING\n")
        assert port.read(60.0).startswith(b"ERR 13 ")


def test_a_missing_port_is_an_error() -> None:
    with ExitStack() as closers, pytest.raises(PortMissing):
        open_line(LineSettings(port="/dev/none"), LinkContext(CommandState(P), closers))


def test_a_script_beside_the_stage_uses_the_expressions_of_the_stage(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('steps = ["0 EXPR smirk"]')
    more = tmp_path / "more.toml"
    more.write_text("[smirk]\nweights = { mouthSmileLeft = 0.7 }\n")
    state = CommandState(P)
    with ExitStack() as closers:
        context = LinkContext(state, closers, (more,), tmp_path / "stage.toml")
        link = open_line(LineSettings(port="simulated", script="own.toml"), context)
        assert os.path.exists(link.port)
        eventually(lambda: link.report()["refused"] == {"23": 1})  # the link itself has only the shipped ones
    assert not link.connected  # its port's number may be another program's by now


def test_an_unknown_script_is_refused_before_a_process_starts() -> None:
    with ExitStack() as closers, pytest.raises(ConfigError, match="no script 'toor', did you mean 'tour'"):
        open_line(LineSettings(port="simulated", script="toor"), LinkContext(CommandState(P), closers))


def test_a_host_reports_what_it_counted() -> None:
    host = HostProcess("tour")
    assert host.counts == {}
    host.stop()
    assert host.counts["script"] == "tour" and host.counts["accepted"] == 0
    counts = host.counts
    host.stop()
    assert host.counts == counts


def test_a_script_that_is_wrong_names_file_and_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('steps = ["0 SET jawOpn 1"]')
    with pytest.raises(LinkError, match=r"own\.toml: 1 fault\n  steps\[0\]: unknown parameter 'jawOpn'") as caught:
        HostProcess(str(path))
    assert "omote check" in caught.value.hint


def test_a_host_that_ends_without_a_word_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "_HOST", "controller.base.errors")  # a module that does nothing
    with pytest.raises(LinkError, match="host for script 'tour' did not start"):
        HostProcess("tour")


def test_a_host_that_does_not_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    host = HostProcess("tour")
    monkeypatch.setattr(opening, "_END_TIMEOUT_S", 0.0)
    os.kill(host._process.pid, signal.SIGSTOP)  # it cannot end by itself
    host.stop()
    assert host._process.returncode == -signal.SIGKILL and host.counts == {}
