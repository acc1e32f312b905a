"""Keys of links in the formats: what is wrong is told, and nothing is open to others without leave."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from controller.links.links import read_link


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({}, "give listen, connect, port or send"),
        ({"listen": "127.0.0.1:1", "connect": "tcp:127.0.0.1:1"}, "give only one of"),
        ({"listen": "127.0.0.1:99999"}, "is not HOST:PORT"),
        ({"listen": "127.0.0.1:0"}, "is not HOST:PORT"),
        ({"listen": "a b:5"}, "is not HOST:PORT"),
        ({"listen": "tcp:127.0.0.1:5000"}, "vmc does not travel by tcp; it does by udp"),
        ({"port": "/dev/ttyUSB0"}, "vmc does not travel by serial"),
        ({"send": "127.0.0.1:x"}, "is not HOST:PORT"),
        ({"listen": "0.0.0.0:39539"}, "open_to_network = true allows it"),
        ({"listen": "192.168.1.5:39539"}, "open_to_network = true allows it"),
        ({"listen": "example:39539"}, "open_to_network = true allows it"),
        ({"listen": "127.0.0.1:5", "gains": {"brows": 5.0}}, "must be 0 to 4"),
        ({"listen": "127.0.0.1:5", "lost": "panic"}, "'fade', 'hold', 'neutral' or 'stop'"),
        ({"listen": "127.0.0.1:5", "token": "a-token-of-mine"}, "only TCP has one for vmc"),
        ({"listen": "127.0.0.1:5", "smothing": True}, "Extra inputs"),
    ],
)
def test_what_is_wrong_is_told(keys: dict[str, object], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        read_link({"kind": "vmc", **keys})


@pytest.mark.parametrize(
    ("keys", "shown"),
    [
        ({"listen": "127.0.0.1"}, "vmc on udp:127.0.0.1:39539"),
        ({"listen": "localhost:5"}, "vmc on udp:localhost:5"),
        ({"listen": "[::1]:5"}, "vmc on udp:[::1]:5"),
        ({"listen": "127.0.0.2:5", "send": "10.0.0.1:6"}, "vmc on udp:127.0.0.2:5 and udp:10.0.0.1:6 (out)"),
        ({"listen": "0.0.0.0:5", "open_to_network": True}, "vmc on udp:0.0.0.0:5"),
    ],
)
def test_what_is_right_is_shown_as_people_write_it(keys: dict[str, object], shown: str) -> None:
    assert str(read_link({"kind": "vmc", **keys})) == shown


@pytest.mark.parametrize(
    ("keys", "needed"),
    [
        ({"kind": "json", "listen": "tcp:127.0.0.1:5"}, False),
        ({"kind": "json", "listen": "tcp:127.0.0.1:5", "token": "a-token-of-mine"}, True),
        ({"kind": "json", "listen": "tcp:0.0.0.0:5", "open_to_network": True}, True),
        ({"kind": "json", "listen": "udp:0.0.0.0:5", "open_to_network": True}, True),
        ({"kind": "json", "listen": "udp:127.0.0.1:5"}, False),
        ({"kind": "json", "listen": "udp:127.0.0.1:5", "token": "a-token-of-mine"}, True),
        ({"kind": "au-json", "listen": "udp:0.0.0.0:5", "open_to_network": True}, False),
        ({"kind": "livelink", "listen": "0.0.0.0:5", "open_to_network": True}, False),
        ({"kind": "ifacialmocap", "listen": "tcp:0.0.0.0:5", "open_to_network": True}, False),
        ({"kind": "json", "connect": "tcp:10.0.0.1:5"}, False),
        ({"kind": "json", "send": "tcp:10.0.0.1:5", "token": "a-token-of-mine"}, False),
    ],
)
def test_which_links_need_a_token(keys: dict[str, object], needed: bool) -> None:
    assert read_link(keys).own.needs_token == needed


def test_a_token_must_be_hard_to_guess() -> None:
    with pytest.raises(ValidationError, match="at least 12"):
        read_link({"kind": "json", "listen": "tcp:127.0.0.1:5", "token": "short"})
