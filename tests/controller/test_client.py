"""controller.client: programs move a face through it, at once or with asyncio, without the rest of omote."""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.client import AsyncFace, Face, FaceError, _Dialogue
from controller.layers.commands import CommandState
from tests.controller.links.websocket.far import served, tick

HEAVY = {"numpy", "numba", "pydantic", "moderngl", "serial", "surface", "drivers"}
JAW, SMILE = P.index("jawOpen"), P.index("mouthSmileLeft")


@pytest.fixture
def far() -> Iterator[tuple[CommandState, Any, str]]:
    with served() as found:
        yield found


def test_ten_lines_move_a_face(far: tuple[CommandState, Any, str]) -> None:
    state, _, url = far
    with Face(url) as face:
        assert face.set(jawOpen=0.4, mouthSmile_L=0.7)["type"] == "ok"
        assert state.mixer["manual"].values[[JAW, SMILE]].tolist() == [0.4, 0.7]
        tick(state)
        assert face.state()["parameters"]["jawOpen"] == pytest.approx(0.4, abs=1e-3)
        face.release("jawOpen")
        assert state.mixer["manual"].holding == 1
        face.neutral(0.1)
        assert state.mixer["manual"].holding == 0


def test_every_request_is_one_that_the_face_takes(far: tuple[CommandState, Any, str]) -> None:
    state, link, url = far
    with Face(url) as face:
        face.expression("surprise", 0.8, seconds=2.0)
        face.emotion(0.5, 0.2, -0.1)
        face.gaze(10, 5)
        face.gaze_at(100, 0, 500)
        face.gaze_off()
        face.life(0.5, "alone")
        face.release()
        face.stop()
        assert state.stop_latch.stopped is not None
        face.start()
        assert face.names("expressions")["names"] == list(state.vocabulary.names)
        assert face.hello()["version"] == 1
        for refused in (lambda: face.show("tour"), lambda: face.show_action("pause")):
            with pytest.raises(FaceError, match="no shows") as caught:
                refused()
            assert caught.value.hint
    assert link.report()["refused"] == {"name": 2}


def test_states_come_at_a_rate_and_end_when_nobody_wants_them(far: tuple[CommandState, Any, str]) -> None:
    _, _, url = far
    with Face(url) as face:
        seen = []
        for state in face.states(100, "jawOpen"):
            seen.append(state)
            if len(seen) == 5:
                break
        assert all(list(each["parameters"]) == ["jawOpen"] for each in seen)
        assert face.set(jawOpen=0.1)["type"] == "ok"


def test_the_same_with_asyncio(far: tuple[CommandState, Any, str]) -> None:
    state, _, url = far

    async def program() -> int:
        async with AsyncFace(url) as face:
            await face.set(jawOpen=0.4)
            with pytest.raises(FaceError, match="did you mean"):
                await face.expression("surprize")
            count = 0
            async for each in face.states(100):
                count += len(each["parameters"]) == len(P)
                if count == 3:
                    return count
        return 0

    assert asyncio.run(program()) == 3
    assert state.mixer["manual"].values[JAW] == 0.4


def test_errors_say_what_to_do(far: tuple[CommandState, Any, str]) -> None:
    _, link, url = far
    with Face(url) as face:
        with pytest.raises(FaceError, match="did you mean"):
            face.set(jawOpn=0.5)
        assert face.set(jawOpen=0.5)["type"] == "ok"
        link.stop()
        with pytest.raises(FaceError, match="closed"):
            face.set(jawOpen=0.5)
    with pytest.raises(FaceError, match="no face there") as caught:
        Face(url)
    assert "websocket" in caught.value.hint
    with pytest.raises(FaceError, match="not connected"):
        asyncio.run(AsyncFace(url).set(jawOpen=0.5))


def test_a_face_that_goes_while_its_states_are_read_is_said_to_be_gone(far: tuple[CommandState, Any, str]) -> None:
    _, link, url = far

    async def program() -> None:
        async with AsyncFace(url) as face:
            async for _ in face.states(100):
                link.stop()

    with Face(url) as face:
        states = face.states(100)
        next(states)
        with pytest.raises(FaceError, match="closed"):
            asyncio.run(program())
        with pytest.raises(FaceError, match="closed"):
            for _ in states:
                pass


def test_states_may_come_more_slowly_than_answers(far: tuple[CommandState, Any, str]) -> None:
    state, _, url = far
    with Face(url, wait_s=0.5) as face:
        states = face.states(1.0, "jawOpen")
        for value in (0.1, 0.2, 0.3):
            state.set_parameters([JAW], [value], 1)
            tick(state)
            assert list(next(states)["parameters"]) == ["jawOpen"]


@pytest.mark.parametrize("answer", [b"", b"ERR line too long\r\n", b"HTTP/1.1 200 OK\r\n\r\n"])
def test_a_port_of_something_else_is_no_face(answer: bytes) -> None:
    """Of the line link, which hangs up, and of any other service."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"ws://127.0.0.1:{server.getsockname()[1]}"

        def serve() -> None:
            for _ in range(2):
                call, _ = server.accept()
                with call:
                    call.recv(1000)
                    call.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        with pytest.raises(FaceError, match=r"ws://127\.0\.0\.1"):
            Face(url)
        with pytest.raises(FaceError, match=r"ws://127\.0\.0\.1"):
            asyncio.run(_enter(AsyncFace(url)))
        thread.join(10.0)


async def _enter(face: AsyncFace) -> None:
    async with face:
        pass


def test_a_wrong_token_is_told_in_the_words_of_the_face() -> None:
    with served(token="correct horse battery") as (_, _, url):
        with pytest.raises(FaceError, match="a token is needed"):
            Face(url)
        with Face(url, token="correct horse battery") as face:
            assert face.hello()["version"] == 1


def test_without_its_package_the_extra_is_named() -> None:
    program = "import sys; sys.modules['websockets'] = None; import controller.client"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "pip install 'omote[web]'" in done.stderr.splitlines()[-1]


def test_it_loads_nothing_heavy() -> None:
    code = "import sys, controller.client; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    root = Path(__file__).resolve().parents[2]
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root).stdout
    assert not HEAVY & set(found.split())


def test_every_request_has_its_own_number() -> None:
    dialogue = _Dialogue()
    asked = [dialogue.request("get", {"parameters": None, "what": "x"}) for _ in range(3)]
    assert [number for number, _ in asked] == [1, 2, 3]
    assert [json.loads(text) for _, text in asked] == [{"type": "get", "id": k, "what": "x"} for k in (1, 2, 3)]
