"""Settings of a WebSocket link: addresses, who may connect."""

from __future__ import annotations

import sys

import pytest
from pydantic import ValidationError

from controller.links.kind import LINKS
from controller.links.links import read_link
from drivers.base.errors import PluginError


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
        ({"listen": "8765"}, "is not an address"),
        ({"listen": "127.0.0.1:99999"}, "is not an address"),
        ({"listen": "127.0.0.1:"}, "is not an address"),
        ({"listen": "0.0.0.0:8765"}, "open_to_network = true allows it"),
        ({"listen": "robot.local:8765"}, "open_to_network = true allows it"),
        ({"token": "short"}, "at least 12 characters"),
    ],
)
def test_what_is_wrong_is_refused(keys: dict[str, object], part: str) -> None:
    with pytest.raises(ValidationError, match=part):
        read_link({"kind": "websocket", **keys})


def test_without_its_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith(("websockets", "controller.links.websocket.server"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "websockets", None)
    kind = LINKS.get("websocket")
    with pytest.raises(PluginError, match="websockets") as caught:
        LINKS.load(kind, kind.open)
    assert caught.value.hint == 'pip install "omote[web]"'
