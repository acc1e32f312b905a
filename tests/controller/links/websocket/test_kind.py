"""Settings of a WebSocket link: addresses, who may connect."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from controller.links.links import read_link


def test_the_address_and_when_a_token_is_needed() -> None:
    plain = read_link({"kind": "websocket"}).own
    assert (plain.where, plain.needs_token, plain.address) == (("127.0.0.1", 8765), False, "127.0.0.1:8765")
    six = read_link({"kind": "websocket", "listen": "[::1]:9000"}).own
    assert (six.where, six.needs_token) == (("::1", 9000), False)
    wide = read_link({"kind": "websocket", "listen": "0.0.0.0:8765", "open_to_network": True}).own
    assert wide.needs_token


@pytest.mark.parametrize(
    ("keys", "part"),
    [
        ({"listen": "8765"}, "is no address"),
        ({"listen": "127.0.0.1:99999"}, "is no address"),
        ({"listen": "127.0.0.1:"}, "is no address"),
        ({"listen": "0.0.0.0:8765"}, "open_to_network = true allows it"),
        ({"listen": "robot.local:8765"}, "open_to_network = true allows it"),
        ({"token": "short"}, "at least 12 characters"),
    ],
)
def test_what_is_wrong_is_refused(keys: dict[str, object], part: str) -> None:
    with pytest.raises(ValidationError, match=part):
        read_link({"kind": "websocket", **keys})
