"""drivers.sim.serving.child: the process behind ``SimulatedBus(process=True)``, here in this process."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest

from drivers.sim.serving import child
from drivers.sim.serving.serve import make_server

SETTINGS = {
    "servos": [[1, "xl330-m288"], [2, "xl320"]],
    "link": None,
    "baud": 1_000_000,
    "faults": ["mute:2"],
    "seed": 0,
    "wire": False,
    "latency_s": 0.0,
    "family": "dynamixel",
    "options": {},
}


@pytest.fixture
def standard_input(monkeypatch):
    """Feeds a text to standard input, which then ends."""
    handler = signal.getsignal(signal.SIGINT)

    def feed(text: str) -> None:
        reading, writing = os.pipe()
        os.write(writing, text.encode())
        os.close(writing)
        monkeypatch.setattr(child.sys, "stdin", os.fdopen(reading))

    yield feed
    signal.signal(signal.SIGINT, handler)
    child.sys.stdin.close()


def test_it_says_ready_and_ends_with_its_input(standard_input, capsys, tmp_path: Path):
    standard_input(json.dumps({**SETTINGS, "link": str(tmp_path / "port")}) + "\n")
    assert child.main() == 0
    assert capsys.readouterr().out == f"ready {tmp_path / 'port'}\n"
    assert os.listdir(tmp_path) == []


def test_it_says_what_is_wrong(standard_input, capsys):
    standard_input(json.dumps({**SETTINGS, "faults": ["nonsense"]}) + "\n")
    assert child.main() == 1
    assert capsys.readouterr().out.startswith("error fault 'nonsense'")


@pytest.mark.parametrize("text", ["", '{"servos"'])
def test_a_parent_that_goes_at_once_is_no_error(standard_input, capsys, text: str):
    standard_input(text)
    assert child.main() == 0
    assert capsys.readouterr().out == ""


def test_make_server_makes_the_servos_and_sets_the_faults():
    server = make_server(SETTINGS)
    try:
        assert [servo.table.model for servo in server.line.servos] == ["xl330-m288", "xl320"]
        assert [fault.kind for fault in server.line.faults.active] == ["mute"]
    finally:
        server.port.close()
