"""Which receiver an address gives, and what a called program hears first."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from controller.links.net import opening as module
from controller.links.net.opening import greeting_of, open_receiver
from controller.links.net.receivers import auth_message


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What each receiver was made with, by its name."""
    made: list[Any] = []
    for name in ("UdpCaller", "UdpReceiver", "TcpCaller", "TcpListener", "SerialReceiver", "InputReceiver"):
        monkeypatch.setattr(module, name, lambda *given, name=name: made.append((name, *given)) or name)
    return made


@pytest.mark.parametrize(
    ("transport", "connect", "name", "given"),
    [
        ("udp", False, "UdpReceiver", ["address", "gate"]), ("udp", True, "UdpCaller", ["address", b"hello"]),
        ("tcp", False, "TcpListener", ["address", "gate"]), ("tcp", True, "TcpCaller", ["address", b"hello"]),
        ("serial", False, "SerialReceiver", ["/dev/x", 9600]), ("serial", True, "SerialReceiver", ["/dev/x", 9600]),
        ("stdin", False, "InputReceiver", []),
    ],
)  # fmt: skip
def test_each_address_has_its_receiver(
    transport: str, connect: bool, name: str, given: list[Any], opened: list[Any]
) -> None:
    address: Any = SimpleNamespace(transport=transport, device="/dev/x")
    gate: Any = "gate"
    found = open_receiver(address, connect=connect, baud=9600, gate=gate, greeting=b"hello")
    assert found == name  # type: ignore[comparison-overlap]
    values = {"address": address, "gate": gate}
    assert opened == [(name, *(values.get(each, each) if isinstance(each, str) else each for each in given))]


def test_a_serial_port_has_115200_baud_unless_somebody_says_otherwise(opened: list[Any]) -> None:
    open_receiver(SimpleNamespace(transport="serial", device="/dev/x"))  # type: ignore[arg-type]
    assert opened == [("SerialReceiver", "/dev/x", 115_200)]


def test_a_called_program_hears_the_token_and_then_what_its_format_wants() -> None:
    form: Any = SimpleNamespace(delimiter=b"\n", greeting=b"SUB 30\n")
    assert greeting_of(form, None) == b"SUB 30\n"
    assert greeting_of(form, "s3cret") == auth_message("s3cret") + b"\n" + b"SUB 30\n"
    assert b"s3cret" in auth_message("s3cret")
