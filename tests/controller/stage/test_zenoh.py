"""controller.stage.zenoh: how a process meets the others, and who may reach it."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from controller.stage.zenoh import ROLES, TlsSettings, ZenohSettings


def settings(**table: Any) -> ZenohSettings:
    return ZenohSettings.model_validate(table)


def fault(**table: Any) -> str:
    """What is said of a wrong table."""
    with pytest.raises(ValidationError) as caught:
        settings(**table)
    return str(caught.value)


@pytest.mark.parametrize(
    ("table", "way"),
    [
        ({"connect": ["tcp/a:1"]}, "client"),
        ({"listen": ["tcp/127.0.0.1:1"]}, "router"),
        ({"connect": ["tcp/a:1"], "listen": ["tcp/127.0.0.1:1"]}, "router"),
        ({"config": "own.json5"}, "client"),
        ({"connect": ["tcp/a:1"], "mode": "peer"}, "peer"),
        ({"listen": ["tcp/127.0.0.1:1"], "mode": "client"}, "client"),
    ],
)
def test_who_listens_routes_and_who_only_connects_is_a_client(table: dict[str, Any], way: str) -> None:
    assert settings(**table).way == way


@pytest.mark.parametrize(
    ("endpoint", "far"),
    [
        ("tcp/127.0.0.1:7447", False),
        ("tcp/127.9.9.9:7447", False),
        ("tls/localhost:1", False),
        ("udp/[::1]:7447", False),
        ("unixsock-stream//tmp/omote.sock", False),
        ("tcp/0.0.0.0:7447", True),
        ("quic/[::]:7447", True),
        ("tcp/192.168.1.5:7447", True),
        ("tcp/128.0.0.1:7447", True),
        ("tcp/localhost.example.org:7447", True),
        ("tcp/1127.0.0.1:7447", True),
    ],
)
def test_others_reach_only_who_says_so(endpoint: str, far: bool) -> None:
    if far:
        why = f"other machines can reach {endpoint}; set open_to_network = true"
        assert why in fault(listen=["tcp/[::1]:1", endpoint])
    else:
        settings(listen=[endpoint])
    assert settings(listen=[endpoint], open_to_network=True).listen == [endpoint]
    assert settings(connect=[endpoint]).listen == []  # to connect opens nothing


@pytest.mark.parametrize("endpoint", ["7447", "tcp:127.0.0.1:1", "tcp/", "http/localhost:1", " tcp/localhost:1"])
def test_an_endpoint_has_a_protocol_and_an_address(endpoint: str) -> None:
    assert "connect.0" in fault(connect=[endpoint])
    assert "listen.0" in fault(listen=[endpoint])


def test_nothing_is_searched_for() -> None:
    assert "give listen or connect" in fault() and "there is no discovery" in fault(role="head")


@pytest.mark.parametrize("prefix", ["", "/omote", "omote/", "a//b", "a b", "ä", "a/*", "a" * 129])
def test_a_prefix_is_words_between_single_slashes(prefix: str) -> None:
    assert "prefix" in fault(connect=["tcp/a:1"], prefix=prefix)
    assert settings(connect=["tcp/a:1"], prefix="show/left_2").prefix == "show/left_2"


@pytest.mark.parametrize(("key", "lowest", "highest"), [("lease_ms", 100, 10_000), ("delay_ms", 0, 1000)])
def test_times_have_their_bounds(key: str, lowest: float, highest: float) -> None:
    for good in (lowest, highest):
        assert getattr(settings(connect=["tcp/a:1"], **{key: good}), key) == good
    for bad in (lowest - 0.1, highest + 0.1, float("nan")):
        assert key in fault(connect=["tcp/a:1"], **{key: bad})


def test_lists_are_bounded() -> None:
    for key, most, entry in (("heads", 256, "a"), ("connect", 64, "tcp/a:1"), ("listen", 64, "tcp/localhost:1")):
        settings(**{"connect": ["tcp/a:1"], key: [entry] * most})
        assert key in fault(**{"connect": ["tcp/a:1"], key: [entry] * (most + 1)})


def test_a_certificate_needs_its_key_and_each_side_shows_one_unless_it_says_otherwise() -> None:
    for half in ({"certificate": "a"}, {"key": "b"}):
        with pytest.raises(ValidationError, match="certificate and key go together"):
            TlsSettings.model_validate({"ca": "ca.pem", **half})
    whole = TlsSettings.model_validate({"ca": "ca.pem", "certificate": "a", "key": "b"})
    assert whole.mutual and not TlsSettings.model_validate({"ca": "c", "mutual": False}).mutual
    with pytest.raises(ValidationError, match="ca"):
        TlsSettings.model_validate({})


def test_what_is_not_said_is_as_documented() -> None:
    made = settings(connect=["tcp/a:1"])
    assert ROLES == ("conductor", "head", "face", "recorder") and made.role == "conductor"
    assert (made.lease_ms, made.delay_ms, made.payload, made.prefix) == (250.0, 0.0, "exact", "omote")
    assert not made.shared_memory and not made.open_to_network and made.tls is None and made.record == "recorded"
