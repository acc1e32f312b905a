"""A network that is cut in two, each half with a router, a conductor and a head: nobody ever obeys two."""

from __future__ import annotations

import select
import socket
import threading
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest

zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from controller.fleet.lease import Token  # noqa: E402
from tests.controller.fleet.nodes import Running, free_port, joined, router, until  # noqa: E402


class Cable:
    """A TCP connection between two routers that can be cut; ``to`` : the port of one, for the other at ``port``."""

    def __init__(self, to: int) -> None:
        self.port, self._to, self._whole, self._over = free_port(), to, threading.Event(), threading.Event()
        self._whole.set()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def cut(self) -> None:
        self._whole.clear()

    def mend(self) -> None:
        self._whole.set()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.is_set():
            if self._whole.wait(0.05):
                with ExitStack() as stack:
                    self._carry(stack)

    def _carry(self, stack: ExitStack) -> None:
        """Carry what one end says to the other, until the cable is cut."""
        front = stack.enter_context(socket.create_server(("127.0.0.1", self.port)))
        ends: dict[socket.socket, socket.socket] = {}
        while self._whole.is_set() and not self._over.is_set():
            for ready in select.select([front, *ends], [], [], 0.02)[0]:
                if ready is front:
                    near = stack.enter_context(front.accept()[0])
                    far = stack.enter_context(socket.create_connection(("127.0.0.1", self._to)))
                    ends |= {near: far, far: near}
                elif ready in ends:
                    _pass_on(ready, ends)


def _pass_on(ready: socket.socket, ends: dict[socket.socket, socket.socket]) -> None:
    """Pass on what one end has said; when it is gone, the other one goes."""
    other = ends[ready]
    try:
        data = ready.recv(1 << 16)
        other.sendall(data)
    except OSError:
        data = b""
    if not data:
        for end in (ready, other):
            del ends[end]
            end.close()


class Half:
    """One half: a router, a conductor and a head; ``obeyed`` : the tokens that the head obeyed, in order."""

    def __init__(self, stack: ExitStack, folder: Path, config: dict[str, object], seed: int) -> None:
        self.endpoint = stack.enter_context(router(config))
        more = {"folder": folder, "prefix": "cut", "hz": 40.0}
        self.conductor = stack.enter_context(Running(self.endpoint, "conductor", seed=seed, **more))
        self.head = stack.enter_context(Running(self.endpoint, "head", seed=seed + 50, **more))
        self.obeyed: list[Token] = []
        follower = self.head.node.followers["maple"]
        take = follower.take

        def noting(header, values):  # type: ignore[no-untyped-def]
            taken = take(header, values)
            if taken and (not self.obeyed or self.obeyed[-1] != header.token):
                self.obeyed.append(header.token)
            return taken

        follower.take = noting  # type: ignore[method-assign]

    @property
    def obeys(self) -> Token:
        return self.head.node.followers["maple"].highest


@pytest.mark.slow
def test_each_half_of_a_cut_network_has_a_conductor_and_one_is_left_when_it_is_whole_again(tmp_path: Path) -> None:
    with ExitStack() as stack:
        near = Half(stack, tmp_path, {}, 1)
        until(joined(near.head))
        cable = Cable(int(near.endpoint.rpartition(":")[2]))
        stack.callback(cable.close)
        over = {"connect/endpoints": [f"tcp/127.0.0.1:{cable.port}"], "connect/exit_on_failure": False,
                  "connect/retry": {"period_init_ms": 100, "period_max_ms": 200}}  # fmt: skip
        far = Half(stack, tmp_path, over, 2)
        first, other = near.conductor.node.lease, far.conductor.node.lease
        until(joined(far.head))
        until(lambda: near.obeys == far.obeys and [first.active, other.active].count(True) == 1)
        for _ in range(2):
            before = max(near.obeys, far.obeys)
            cable.cut()
            until(lambda: near.obeys.holder == first.holder and far.obeys.holder == other.holder)  # each its own half's
            until(lambda: first.active and other.active and near.obeys != far.obeys)
            until(joined(near.head, far.head))
            assert max(near.obeys, far.obeys) > before
            cable.mend()
            until(lambda: near.obeys == far.obeys)
            until(joined(near.head, far.head))
            until(lambda: [first.active, other.active].count(True) == 1)
    for half in (near, far):
        assert len(half.obeyed) >= 2
        assert all(after > before for before, after in pairwise(half.obeyed)), half.obeyed  # never back to a lower one
