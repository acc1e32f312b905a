"""controller.base.service_manager: what systemd is told, and when."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

from controller.base.service_manager import ServiceManager

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no Unix sockets")


def test_readiness_pings_and_the_end_are_told(tmp_path: Path) -> None:
    now = [0.0]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(1.0)
        environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "9000000"}
        manager = ServiceManager(environment, lambda: now[0])
        manager.ready()
        for now_s, sequence in ((0.0, 1), (2.9, 2), (3.1, 2), (6.5, 2), (6.6, 3)):
            now[0] = now_s
            manager.alive(sequence)
        manager.stopping()
        told = [systemd.recv(64).decode() for _ in range(5)]
    assert told == ["READY=1", "WATCHDOG=1", "WATCHDOG=1", "WATCHDOG=1", "STOPPING=1"]


def test_a_body_that_stands_still_gives_no_sign_of_life(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.setblocking(False)
        environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"}
        now = [0.0]
        manager = ServiceManager(environment, lambda: now[0])
        for now[0] in range(10):
            manager.alive(7)
        assert systemd.recv(64) == b"WATCHDOG=1"
        with pytest.raises(BlockingIOError):
            systemd.recv(64)


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all", "WATCHDOG_USEC": "1"}])
def test_nothing_happens_outside_of_a_service(environment: dict[str, str]) -> None:
    manager = ServiceManager(environment)
    assert manager.watches == bool(environment)
    manager.ready()
    manager.alive(1)
    manager.stopping()


@pytest.mark.skipif(sys.platform != "linux", reason="abstract addresses are of Linux")
def test_an_address_with_an_at_sign_is_an_abstract_one() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind("")  # Linux gives an abstract address
        systemd.settimeout(1.0)
        ServiceManager({"NOTIFY_SOCKET": "@" + systemd.getsockname()[1:].decode()}).ready()
        assert systemd.recv(64) == b"READY=1"


@pytest.mark.parametrize(
    "given", [{"NOTIFY_SOCKET": "/a"}, {"WATCHDOG_USEC": "1"}, {"NOTIFY_SOCKET": "/a", "WATCHDOG_USEC": "soon"}]
)
def test_no_sign_of_life_is_sent_that_nobody_waits_for(given: dict[str, str]) -> None:
    assert not ServiceManager(given).watches


@pytest.mark.parametrize(("now_s", "pings"), [(2.9, 1), (3.0, 2), (3.1, 2)])
def test_a_ping_is_due_after_a_third_of_the_time(monkeypatch: pytest.MonkeyPatch, now_s: float, pings: int) -> None:
    now, told = [0.0], list[str]()
    manager = ServiceManager({"NOTIFY_SOCKET": "/a", "WATCHDOG_USEC": "9000000"}, lambda: now[0])
    monkeypatch.setattr(manager, "_send", told.append)
    manager.alive(0)  # the first one at once, whatever the number
    now[0] = now_s
    manager.alive(1)
    assert told == ["WATCHDOG=1"] * pings
