"""controller.links.web.server over real sockets: pages, the face and the WebSocket API at one address."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from controller.base.parameters import PARAMETERS
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import open_links, read_link
from controller.links.web.kind import LINK
from drivers.base.shutdown import Closers
from tests.controller.links.net.sockets import wait_for

TOKEN = "correct horse battery"
WAIT_S = 20.0


@contextmanager
def panel(**keys: Any) -> Iterator[tuple[CommandState, Any]]:
    state, closers = CommandState(PARAMETERS), Closers()
    table = {"kind": LINK.kind, "listen": "127.0.0.1:0", **keys}
    try:
        (link,) = open_links([read_link(table)], LinkContext(state, closers))
        yield state, link
    finally:
        with suppress(Exception):
            closers.close()


def get(link: Any, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    connection = HTTPConnection("127.0.0.1", link.port, timeout=WAIT_S)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    found = answer.status, answer.read(), dict(answer.getheaders())
    connection.close()
    return found


def test_page_and_api_at_one_address(tmp_path: Path) -> None:
    face = tmp_path / "face.glb"
    face.write_bytes(bytes(3_000_000))
    with panel(face=str(face)) as (state, link):
        status, body, headers = get(link, "/")
        assert status == 200 and body[:2] == b"\x1f\x8b" and headers["X-Content-Type-Options"] == "nosniff"
        status, _, told = get(link, "/face.glb")
        assert status == 200
        status, body, _ = get(link, "/face.glb", **{"If-None-Match": told["ETag"]})
        assert (status, body) == (304, b"")
        assert get(link, "/nothing")[0] == 404
        with connect(f"ws://127.0.0.1:{link.port}/ws") as client:
            client.send('{"type": "set", "parameters": {"jawOpen": 0.5}, "id": 1}')
            assert json.loads(client.recv(WAIT_S)) == {"id": 1, "type": "ok"}
            client.send('{"type": "stop"}')
            wait_for(lambda: state.stop_latch.stopped is not None)
        assert state.held()[PARAMETERS.index("jawOpen")] == 0.5


def test_with_a_token_the_face_and_the_api_need_it_and_the_empty_page_does_not(tmp_path: Path) -> None:
    face = tmp_path / "face.glb"
    face.write_bytes(b"face")
    with panel(face=str(face), token=TOKEN) as (_, link):
        assert get(link, "/")[0] == 200
        assert get(link, "/face.glb")[0] == 401
        assert get(link, "/face.glb", Authorization=f"Bearer {TOKEN}")[0] == 200
        with pytest.raises(InvalidStatus, match="401"):
            connect(f"ws://127.0.0.1:{link.port}/ws")


def test_pages_of_elsewhere_are_turned_away() -> None:
    with panel() as (_, link):
        assert get(link, "/", Host="evil.example")[0] == 403
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://127.0.0.1:{link.port}/ws", origin="http://evil.example")  # type: ignore[arg-type]


def test_an_overview_tells_of_servos_links_and_what_another_client_holds() -> None:
    with panel() as (state, link):
        state.set_parameters([PARAMETERS.index("jawOpen")], [0.25], 1)
        state.servo_records = lambda: [
            {"bus": "head", "id": 1, "name": "jaw", "model": "m", "low_deg": -9.0, "high_deg": 9.0, "wanted_deg": 1.0}
        ]
        with connect(f"ws://127.0.0.1:{link.port}/ws") as client:
            client.send('{"type": "watch", "rate_hz": 10}')
            for _ in range(2):
                told = json.loads(client.recv(WAIT_S))
                assert told["type"] == "overview" and told["held"] == {"jawOpen": 0.25}
                assert told["servos"][0]["name"] == "jaw" and told["servos"][0]["measured_deg"] is None
            client.send('{"type": "watch", "rate_hz": 0}')
            client.send('{"type": "subscribe", "rate_hz": 100, "form": "numbers"}')
            while (told := json.loads(client.recv(WAIT_S)))["type"] != "frame":
                assert told["type"] == "overview"
            assert len(told["values"]) == len(PARAMETERS)
