"""controller.links.websocket.server over real sockets, with clients that do as they like."""

from __future__ import annotations

import json
import logging
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.websocket import server
from tests.controller.links.net.sockets import wait_for
from tests.controller.links.websocket.far import served

WAIT_S = 60.0
JAW = P.index("jawOpen")


@pytest.fixture
def far() -> Iterator[tuple[CommandState, Any, str]]:
    with served() as found:
        yield found


def ask(client: ClientConnection, kind: str, **fields: Any) -> dict[str, Any]:
    client.send(json.dumps({"type": kind, "id": 1, **fields}))
    while True:
        reply: dict[str, Any] = json.loads(client.recv(WAIT_S))
        if reply.get("id") == 1:
            return reply


def held(state: CommandState) -> float:
    return float(state.mixer["manual"].values[JAW])


def test_the_documents_first_messages(far: tuple[CommandState, Any, str]) -> None:
    state, link, url = far
    with connect(url) as client:
        client.send('{"type": "set", "parameters": {"jawOpen": 0.5}}')
        client.send('{"type": "get"}')
        assert json.loads(client.recv(WAIT_S))["type"] == "state"
        assert held(state) == 0.5
        client.send('{"type": "subscribe", "rate_hz": 30}')
        assert [json.loads(client.recv(WAIT_S))["type"] for _ in range(3)] == ["state"] * 3
        assert link.report()["clients"] == 1
    wait_for(lambda: link.report()["clients"] == 0)
    assert (link.report()["served"], link.report()["accepted"]) == (1, 3)


def test_a_handshake_and_a_frame_written_by_hand(far: tuple[CommandState, Any, str]) -> None:
    """RFC 6455, section 1.3: its key and the answer to it; section 5.7: a masked text frame."""
    state, _, url = far
    host, port = url.removeprefix("ws://").split(":")
    with socket.create_connection((host, int(port)), timeout=WAIT_S) as raw:
        key = "dGhlIHNhbXBsZSBub25jZQ=="
        lines = ["GET / HTTP/1.1", f"Host: {host}:{port}", "Upgrade: websocket", "Connection: Upgrade",
                 f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", "", ""]  # fmt: skip
        raw.sendall("\r\n".join(lines).encode())
        answer = b""
        while b"\r\n\r\n" not in answer:
            answer += raw.recv(4096)
        assert answer.startswith(b"HTTP/1.1 101") and b"s3pPLMBiTxaQ9kYGzzhZRbK+xOo=" in answer
        text, mask = b'{"type":"set","parameters":{"jawOpen":0.25}}', b"\x37\xfa\x21\x3d"
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(text))
        raw.sendall(bytes((0x81, 0x80 | len(text))) + mask + masked)
        wait_for(lambda: held(state) == 0.25)


def test_two_clients_see_each_others_changes(far: tuple[CommandState, Any, str]) -> None:
    _, _, url = far
    with connect(url) as one, connect(url) as other:
        ask(one, "stop")
        assert ask(other, "get")["stopped_by"].startswith("websocket 127.0.0.1:")
        ask(other, "start")
        assert ask(one, "get")["stopped_by"] is None


def test_a_message_that_is_too_long_ends_its_client_and_no_other(far: tuple[CommandState, Any, str]) -> None:
    _, link, url = far
    with connect(url) as good, connect(url) as bad:
        bad.send(json.dumps({"type": "ping", "id": "x" * 70_000}))
        with pytest.raises(ConnectionClosed):
            bad.recv(WAIT_S)
        assert ask(good, "ping")["type"] == "ok"
    assert link.report()["refused"] == {}


@pytest.mark.slow
def test_a_flood_that_reads_nothing_delays_no_stop_of_its_own_or_another(far: tuple[CommandState, Any, str]) -> None:
    state, link, url = far
    flood = json.dumps({"type": "hello", "id": 1})  # whose answer is long
    with connect(url, max_queue=1) as rude, connect(url) as good:
        for _ in range(700):
            rude.send(flood)
        assert ask(good, "ping")["type"] == "ok"
        rude.send('{"type": "stop"}')
        wait_for(lambda: state.stop_latch.stopped is not None, limit_s=WAIT_S)

        def flooding() -> bool:
            """Ask on: how much the sockets of this machine hold before answers are dropped is not known."""
            for _ in range(50):
                rude.send(flood)
            return bool(link.report()["unanswered"])

        wait_for(flooding, limit_s=WAIT_S)


def test_messages_beyond_the_rate_are_dropped_and_the_client_hears_of_it(far: tuple[CommandState, Any, str]) -> None:
    _, _, url = far
    with connect(url) as client:
        for _ in range(6000):
            client.send('{"type": "neutral"}')
        client.send('{"type": "stop", "id": 1}')
        reply = json.loads(client.recv(WAIT_S))
        if reply["type"] == "error":  # unless this machine was too slow to exceed the rate
            assert reply["code"] == "rate"
            reply = json.loads(client.recv(WAIT_S))
            while reply["type"] == "error":
                reply = json.loads(client.recv(WAIT_S))
        assert reply == {"id": 1, "type": "ok"}


def test_messages_that_have_no_answer_take_no_place_of_one_that_has(far: tuple[CommandState, Any, str]) -> None:
    """Many may be read in one go, before anything is sent."""
    state, link, _ = far
    client = server._Client(SimpleNamespace(remote_address=("127.0.0.1", 9)), state, 0, link._meter)  # type: ignore[arg-type]
    for _ in range(server._MAX_WAITING):
        client._take('{"type": "neutral"}')
    client._take('{"type": "stop", "id": 1}')
    answers = [client._waiting.get_nowait() for _ in range(client._waiting.qsize())]
    assert [each.model_dump()["id"] for each in answers if each is not None] == [1] and client.unanswered == 0


def test_pages_from_elsewhere_are_turned_away(far: tuple[CommandState, Any, str]) -> None:
    _, link, url = far
    with pytest.raises(InvalidStatus) as caught:
        connect(url, origin="https://example.org")  # type: ignore[arg-type]
    assert caught.value.response.status_code == 403
    assert b"add it to origins" in caught.value.response.body
    with connect(url, origin="http://localhost:8000") as own:  # type: ignore[arg-type]
        assert ask(own, "ping")["type"] == "ok"
    assert link.report()["turned_away"] == {"origin": 1}


def test_a_page_of_the_list_may_connect() -> None:
    with served(origins=["https://example.org"]) as (_, _, url), connect(url, origin="https://example.org") as page:  # type: ignore[arg-type]
        assert ask(page, "ping")["type"] == "ok"


def test_a_token_is_needed_where_it_is_set() -> None:
    token = "correct horse battery"
    with served(token=token) as (_, link, url):
        for wrong in (url, f"{url}/?token=wrong"):
            with pytest.raises(InvalidStatus) as caught:
                connect(wrong)
            assert caught.value.response.status_code == 401
            assert token.encode() not in (caught.value.response.body or b"")
        with connect(f"{url}/?token=correct%20horse%20battery") as client:
            assert ask(client, "ping")["type"] == "ok"
        with connect(url, additional_headers={"Authorization": f"Bearer {token}"}, origin="https://a.b") as client:  # type: ignore[arg-type]
            assert ask(client, "ping")["type"] == "ok"
        assert link.report()["turned_away"] == {"token": 2}
        assert token not in json.dumps(link.report())


def test_an_open_link_makes_a_token_and_shows_it_once(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    keys = {"listen": "0.0.0.0:0", "open_to_network": True}
    with caplog.at_level(logging.WARNING), served(**keys) as (_, link, _):
        token = (tmp_path / "omote" / "token").read_text().strip()
        assert token in caplog.text and "other machines may move this face and its servos" in caplog.text
        with connect(f"ws://127.0.0.1:{link.port}/?token={token}") as client:
            assert ask(client, "ping")["type"] == "ok"
    caplog.clear()
    with caplog.at_level(logging.WARNING), served(**keys):
        assert token not in caplog.text and str(tmp_path) in caplog.text


def test_more_clients_than_places_are_turned_away_until_one_goes() -> None:
    with served(clients=1) as (_, link, url):
        with connect(url) as first:
            with pytest.raises(InvalidStatus) as caught:
                connect(url)
            assert caught.value.response.status_code == 503
            assert ask(first, "ping")["type"] == "ok"
        wait_for(lambda: link.report()["clients"] == 0)
        with connect(url) as second:
            assert ask(second, "ping")["type"] == "ok"


def test_an_address_that_is_taken_is_an_error_with_the_next_step() -> None:
    with (
        served() as (_, link, _),
        pytest.raises(LinkError, match="cannot listen") as caught,
        served(listen=f"127.0.0.1:{link.port}"),
    ):
        pass
    assert "ss -ltnp" in caught.value.hint


def test_closing_the_link_sends_clients_away_and_frees_the_address() -> None:
    with served() as (_, link, url):
        client = connect(url)
        port = link.port
        link.stop()
        with pytest.raises(ConnectionClosed):
            client.recv(WAIT_S)
    with served(listen=f"127.0.0.1:{port}") as (_, again, _):
        assert again.port == port


@pytest.mark.slow
def test_a_subscriber_that_reads_slowly_gets_fresh_states(far: tuple[CommandState, Any, str]) -> None:
    _, _, url = far
    with connect(url, max_queue=1) as slow:
        ask(slow, "subscribe", rate_hz=200)
        time.sleep(0.5)
        ask(slow, "set", parameters={"jawOpen": 0.75})
        ages = [json.loads(slow.recv(WAIT_S)).get("time_s", 0.0) for _ in range(400)]
        assert ages == sorted(ages)
