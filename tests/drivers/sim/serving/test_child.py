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
def started(monkeypatch):
    """Gives the process its settings and a standard input that ends at once."""
    handlers = {ending: signal.getsignal(ending) for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def start(**settings: object) -> None:
        reading, writing = os.pipe()
        os.close(writing)
        monkeypatch.setattr(child.sys, "stdin", os.fdopen(reading))
        monkeypatch.setattr(child.sys, "argv", ["child", json.dumps(SETTINGS | settings)])

    yield start
    ignored = {ending for ending in handlers if signal.getsignal(ending) == signal.SIG_IGN}
    for ending, handler in handlers.items():
        signal.signal(ending, handler)
    child.sys.stdin.close()
    assert ignored == set(handlers), "signals to the whole process group are the parent's business"


def test_it_says_ready_and_ends_with_its_input(started, capsys, tmp_path: Path):
    started(link=str(tmp_path / "port"))
    assert child.main() == 0
    assert capsys.readouterr().out == f"ready {tmp_path / 'port'}\n"
    assert os.listdir(tmp_path) == []


def test_it_says_what_is_wrong(started, capsys):
    started(faults=["nonsense"])
    assert child.main() == 1
    assert capsys.readouterr().out.startswith("error fault 'nonsense'")


def test_make_server_makes_the_servos_and_sets_the_faults():
    server = make_server(SETTINGS)
    try:
        assert [servo.table.model for servo in server.line.servos] == ["xl330-m288", "xl320"]
        assert [fault.kind for fault in server.line.faults.active] == ["mute"]
    finally:
        server.port.close()
