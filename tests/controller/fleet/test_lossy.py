"""Datagrams that are lost: a head whose declarations are lost joins by itself."""

from __future__ import annotations

import logging
import select
import socket
import threading
import time
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from controller.fleet.session import open_session  # noqa: E402
from controller.stage.zenoh import ZenohSettings  # noqa: E402
from tests.controller.fleet.nodes import Running, free_port, joined, router, until  # noqa: E402
from tests.controller.fleet.test_node import client  # noqa: E402


class Air:
    """A proxy of datagrams to a router's port ``to``.

    losing : texts; the first datagram to the router that has one of them in it is lost.
    answer : the number of the datagram from the router that is lost, from 1; 0: none.
    lost : how many were.
    """

    def __init__(self, to: int, losing: set[bytes], answer: int = 0) -> None:
        self._answer, self._answers = answer, 0
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self.port: int = self._front.getsockname()[1]
        self.losing, self.lost = losing, 0
        self._over = threading.Event()
        self._to, self._ways = to, dict[tuple[str, int], socket.socket]()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            for ready in select.select([self._front, *self._ways.values()], [], [], 0.02)[0]:
                try:
                    self._carry(ready)
                except (ConnectionRefusedError, BlockingIOError):  # the router's port is closed
                    continue

    def _carry(self, ready: socket.socket) -> None:
        data, whom = ready.recvfrom(1 << 16)
        if ready is not self._front:
            self._answers += 1
            if self._answers == self._answer:
                self.lost += 1
                return
            self._front.sendto(data, next(at for at, way in self._ways.items() if way is ready))
        elif not self._is_lost(data):
            if whom not in self._ways:
                self._ways[whom] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self._ways[whom].setblocking(False)
                self._ways[whom].connect(("127.0.0.1", self._to))
            self._ways[whom].send(data)

    def _is_lost(self, data: bytes) -> bool:
        found = {text for text in self.losing if text in data}
        self.losing -= found
        self.lost += bool(found)
        return bool(found)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        for end in (self._front, *self._ways.values()):
            end.close()


def datagram_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("heads", [("maple", "oak"), ("maple", "oak", "elm", "yew")])
def test_a_head_whose_subscription_was_lost_joins_by_another_session(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, heads: tuple[str, ...]
) -> None:
    tcp, udp = free_port(), datagram_port()
    what = b"air/oak/parameters" if len(heads) == 2 else b"air/_/faces"
    config = {"listen/endpoints": [f"tcp/127.0.0.1:{tcp}", f"udp/127.0.0.1:{udp}"]}
    with ExitStack() as stack, caplog.at_level(logging.WARNING):
        hub = stack.enter_context(router(config, f"tcp/127.0.0.1:{tcp}"))
        air = Air(udp, {what})
        stack.callback(air.close)
        more = {"folder": tmp_path, "prefix": "air", "heads": heads}
        conductor = stack.enter_context(Running(hub, "conductor", **more))
        until(lambda: conductor.node.lease.active)
        head = stack.enter_context(Running(f"udp/127.0.0.1:{air.port}", "head", **more))
        until(joined(head))
        assert air.lost == 1
        assert head.node.followers["oak"].refused["of a conductor that was replaced"] == 0
    assert "no face of" in caplog.text


@pytest.mark.slow
def test_a_greeting_whose_last_answer_is_lost_is_tried_by_another_session(tmp_path: Path) -> None:
    """The router refuses the first session as one that it has, for 10 s."""
    udp = datagram_port()
    with router(endpoint=f"udp/127.0.0.1:{udp}"), closing(Air(udp, set(), answer=2)) as air:
        began_s = time.monotonic()
        settings = ZenohSettings(role="head", connect=[f"udp/127.0.0.1:{air.port}"])
        open_session(settings, tmp_path / "stage.toml").close()  # type: ignore[no-untyped-call]
        assert air.lost == 1
        assert time.monotonic() - began_s < 9.0


def test_no_thread_waits_for_an_answer_when_a_process_ends(tmp_path: Path) -> None:
    """One that Zenoh starts for a question aborts Python's end where it still waits then."""
    with router() as hub, client(hub) as session:
        held: list[object] = []
        session.declare_queryable("ends/_/clock", held.append)
        with Running(hub, "head", folder=tmp_path, prefix="ends"):
            before = {thread for thread in threading.enumerate() if thread.daemon}
            until(lambda: len(held) > 5)
            assert {thread for thread in threading.enumerate() if thread.daemon} <= before
