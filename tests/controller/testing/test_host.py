"""controller.testing.host: a robot host at a port, for a program that takes the line protocol."""

from __future__ import annotations

from pathlib import Path

import pytest
import serial

from controller.base.errors import ConfigError
from controller.links.line import host as host_module
from controller.links.line.protocol import checksum
from controller.testing.host import ScriptedHost, open_host


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may answer late."""
    monkeypatch.setattr(host_module, "_ANSWER_TIMEOUT_S", 30.0)


def answer(host: ScriptedHost, *texts: str) -> list[str]:
    """Answer the greetings of a host and then a line with each text, as a face would; returns the lines."""
    heard: list[str] = []
    with serial.Serial(host.port, 115_200, timeout=10) as port:
        while len(heard) < len(texts):
            tag, _, line = port.read_until().strip().decode().partition("*")[0].partition(" ")
            body = f"{tag} {'OK HELLO' if line == 'HELLO' else texts[len(heard)]}".encode()
            port.write(body + b"*%02X\n" % checksum(body))
            heard += [] if line == "HELLO" else [line]
        host.wait_until(lambda report: report["accepted"] + report["refused"] > len(texts), 30.0)
    return heard


def test_a_program_answers_a_script(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    with open_host(steps=["0 SET jawOpen 0.5", "0 EXPR joy"], folder=tmp_path, link=link) as host:
        assert host.port == str(link)
        with pytest.raises(AssertionError, match="0 lines were accepted"):
            host.all_accepted()
        assert answer(host, "OK SET 1", "OK EXPR") == ["SET jawOpen 0.5", "EXPR joy"]
        host.all_accepted()
        assert host.report()["sent"] >= 3


def test_what_is_refused_is_told(tmp_path: Path) -> None:
    with open_host(steps=["0 SET jawOpen 0.5"], folder=tmp_path) as host:
        answer(host, "ERR 23 unknown")
        with pytest.raises(AssertionError, match=r"1 refused[\s\S]*SET jawOpen 0.5 -> ERR 23"):
            host.all_accepted()
        with pytest.raises(AssertionError, match=r"within 0.1 s.*'refused': 1"):
            host.wait_until(lambda report: False, 0.1)


def test_a_shipped_script_and_a_wrong_one(tmp_path: Path) -> None:
    with open_host("tour", folder=tmp_path) as host:
        assert host.report()["script"] == "tour"
    with pytest.raises(ConfigError, match="times must rise"):
        open_host(steps=["1 PING", "0 PING"], folder=tmp_path)
