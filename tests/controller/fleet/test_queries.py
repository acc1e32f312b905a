"""controller.fleet.queries: answers that no conductor gives are refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from controller.fleet.lease import Lease, Token
from controller.fleet.offset import Clocks
from controller.fleet.queries import ConductorQueries


@pytest.mark.parametrize("answer", [b"[1, 2]", b"[1e999, 2, 5]", b"[%d, %d, 5]" % (2**63, 2**63), b"[2, 1, 5]", b"{}"])
def test_a_time_that_no_clock_has_is_refused(answer: bytes) -> None:
    """With a huge one the time of a command left 64 bits, which ended the head's run."""
    heard, refused, clocks = list[Any](), list[Exception](), Clocks()
    wire = SimpleNamespace(ask=lambda head, what, act, *more: heard.append(act), refuse=refused.append)
    ConductorQueries(wire, clocks, Lease(1, 0.2, 0.0, 0.0), {}, {}).poll()  # type: ignore[arg-type]
    heard[0](SimpleNamespace(ok=SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: answer))))
    assert len(refused) == 1
    assert clocks.answers(5) == 0
    heard[0](SimpleNamespace(ok=SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: b"[1, 2, 5]"))))
    assert len(refused) == 1


@pytest.mark.parametrize("answer", [b"[1]", b"5", b"{", b"\xff", b'{"conducting": true}'])
def test_a_state_that_is_no_conductors_is_refused(answer: bytes) -> None:
    asked, refused = dict[str, Any](), list[Exception]()
    wire = SimpleNamespace(ask=lambda head, what, act, *more: asked.update({what: act}), refuse=refused.append)
    lease = Lease(1, 0.2, 0.0, 0.0)
    lease.hear(Token(1, 7), 0.0)
    ConductorQueries(wire, Clocks(), lease, {"maple": None}, {}).poll()  # type: ignore[arg-type, dict-item]
    asked["state"](SimpleNamespace(ok=SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: answer))))
    assert len(refused) == 1
