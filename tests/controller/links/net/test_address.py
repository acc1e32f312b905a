"""Addresses as users write them: what is read, what is written again, who reaches it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from controller.links.net.address import Address, has_token, is_called, parse_address


def form(*transports: str, port: int = 0, **other: Any) -> Any:
    fields = {"kind": "some", "transports": transports, "port": port, "takes_token": False, "greeting": b"", **other}
    return SimpleNamespace(**fields)


EVERY = form("udp", "tcp", "serial", "midi", "lines", port=39539)


@pytest.mark.parametrize(
    ("text", "wanted", "again"),
    [
        ("192.168.0.7:5000", Address("udp", "192.168.0.7", 5000), "udp:192.168.0.7:5000"),
        ("robot.local", Address("udp", "robot.local", 39539), "udp:robot.local:39539"),
        (" :8000 ", Address("udp", "127.0.0.1", 8000), "udp:127.0.0.1:8000"),
        ("TCP:[::1]:65535", Address("tcp", "::1", 65535), "tcp:[::1]:65535"),
        ("udp:0.0.0.0:1", Address("udp", "0.0.0.0", 1), "udp:0.0.0.0:1"),
        ("-", Address("lines"), "-"),
        ("MIDI:Launch Control: 1", Address("midi", device="Launch Control: 1"), "midi:Launch Control: 1"),
        ("/dev/ttyUSB0", Address("serial", device="/dev/ttyUSB0"), "/dev/ttyUSB0"),
        ("serial:port", Address("serial", device="port"), "port"),
        ("com3", Address("serial", device="com3"), "com3"),
        ("socket://10.0.0.1:9000", Address("serial", device="socket://10.0.0.1:9000"), "socket://10.0.0.1:9000"),
    ],
)
def test_an_address_is_read_and_written_again(text: str, wanted: Address, again: str) -> None:
    assert parse_address(text, EVERY) == wanted
    assert str(wanted) == again and parse_address(again if wanted.device != "port" else text, EVERY) == wanted


def test_a_host_travels_as_the_format_does_first() -> None:
    assert parse_address("a:1", form("serial", "tcp", "udp")).transport == "tcp"
    assert parse_address("a:1", form("udp", "tcp")).transport == "udp"


@pytest.mark.parametrize(
    "text",
    [
        "a:",
        "a:0",
        "a:65536",
        "a:x",
        "a:-1",
        "a:١",
        "a b:1",
        "http:\\x:1",
        "udp:a/b:1",
        "tcp:a:1.5",
        "a",
        "a..b:1",
        "ä..b:1",
        "x" * 64 + ":1",
        "a:" + "9" * 5000,
    ],
)
def test_what_is_no_host_and_port_is_named(text: str) -> None:
    with pytest.raises(ValueError, match=r'is not HOST:PORT, as "127\.0\.0\.1:9400"') as caught:
        parse_address(text, form("udp", "tcp"))
    assert repr(text) in str(caught.value)
    with pytest.raises(ValueError, match=r"127\.0\.0\.1:7000"):
        parse_address("a:x", form("udp", port=7000))


@pytest.mark.parametrize(
    ("text", "transport"), [("tcp:a:1", "tcp"), ("/dev/x", "serial"), ("midi:x", "midi"), ("-", "lines")]
)
def test_a_format_that_does_not_travel_so_says_how_it_does(text: str, transport: str) -> None:
    kinds = [each for each in ("udp", "tcp", "serial", "midi", "lines") if each != transport]
    with pytest.raises(ValueError, match=f"some does not travel by {transport}; it does by {', '.join(kinds)}"):
        parse_address(text, form(*kinds))


@pytest.mark.parametrize(
    ("address", "local"),
    [
        (Address("udp", "127.0.0.2", 1), True), (Address("tcp", "::1", 1), True),
        (Address("tcp", "localhost", 1), True),
        (Address("udp", "0.0.0.0", 1), False), (Address("tcp", "10.0.0.1", 1), False),
        (Address("udp", "robot.local", 1), False), (Address("serial", device="/dev/x"), True), (Address("lines"), True),
        (Address("midi", device="x"), True),
    ],
)  # fmt: skip
def test_who_reaches_it(address: Address, local: bool) -> None:
    assert address.is_local == local


def test_tokens_and_calls_need_room() -> None:
    tcp, udp, serial = Address("tcp", "a", 1), Address("udp", "a", 1), Address("serial", device="x")
    plain, able = form("udp"), form("udp", takes_token=True, greeting=b"hello")
    assert [has_token(plain, each) for each in (tcp, udp, serial)] == [True, False, False]
    assert [has_token(able, each) for each in (tcp, udp, serial)] == [True, True, False]
    assert [is_called(plain, each) for each in (tcp, udp, serial)] == [True, False, False]
    assert [is_called(able, each) for each in (tcp, udp, serial)] == [True, True, False]
