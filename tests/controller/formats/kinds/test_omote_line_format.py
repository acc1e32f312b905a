"""Lines of the line protocol: a face to a real omote and back, over TCP, and wrong lines."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import ExitStack

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.formats.kinds.omote_line_format import LineDecoder, LineEncoder
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.line.kind import PORT
from controller.links.line.protocol import MAX_LINE, checksum
from controller.links.links import open_links, read_link
from controller.tools.translate import Options, translate
from tests.controller.formats.faces import face
from tests.controller.links.line.test_server import TOKEN, Far
from tests.controller.links.net.sockets import free_port, wait_for

JAW, YAW = P.index("jawOpen"), P.index("headYaw")


def part(**values: float) -> Frame:
    frame = Frame(P.neutral(), np.zeros(len(P), dtype=bool))
    for name, value in values.items():
        frame.values[P.index(name)], frame.mask[P.index(name)] = value, True
    return frame


def test_a_face_in_parts_is_set_and_released() -> None:
    encoder = LineEncoder(P)
    assert encoder.encode(part(jawOpen=0.5, headYaw=-2.0)) == [b"SET jawOpen 0.5 headYaw -1"]
    assert encoder.encode(part(headYaw=0.25)) == [b"RELEASE jawOpen\nSET headYaw 0.25"]
    assert encoder.encode(Frame(P.neutral(), np.ones(len(P), dtype=bool), face=False)) == [b"RELEASE headYaw"]
    almost = face(1)
    almost.mask[0] = False
    (message,) = encoder.encode(almost)
    assert max(map(len, message.split(b"\n"))) < MAX_LINE and encoder.encode(face(1))[0].startswith(b"FRAME ")


def test_what_hosts_send_and_omote_streams_is_read() -> None:
    decoder = LineDecoder(P)
    (frame,) = decoder.feed(b"P 1500 jawOpen=0.5 headYaw=-0.2")
    assert frame.time_s == 1.5 and frame.values[[JAW, YAW]].tolist() == [0.5, -0.2] and frame.mask.sum() == 2
    line = b"#3 SET jawOpen 0.7"
    (frame,) = decoder.feed(line + b"*%02X\r" % checksum(line))
    assert frame.values[JAW] == 0.7 and frame.mask[YAW]
    (frame,) = decoder.feed(b"RELEASE jawOpen")
    assert not frame.mask[JAW] and frame.mask[YAW]
    (frame,) = decoder.feed(b"release all")
    assert not frame.face
    (frame,) = decoder.feed(b"F 20 " + b" ".join([b"0.25"] * len(P)))
    assert frame.mask.all() and not decoder.refused
    assert decoder.feed(b"OK SET 1") == decoder.feed(b"#1 OK PING") == decoder.feed(b"") == []


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"SET jawOpn 1", "unknown names"),
        (b"RELEASE jawOpn", "unknown names"),
        (b"SET jawOpen nan", "values that are not numbers"),
        (b"SET jawOpen 1e9", "values that are not numbers"),
        (b"P 1 jawOpen", "values that are not numbers"),
        (b"SET jawOpen", "lines that set no parameters"),
        (b"ERR 20 unknown command", "lines that set no parameters"),
        (b"FRAME 1 2", "lines without 59 values"),
        (b"SET jawOpen 0.5*00", "wrong checksums"),
        (b"\xff\xfe\x00", "lines that set no parameters"),
    ],
)
def test_what_is_wrong_is_counted(line: bytes, why: str) -> None:
    decoder = LineDecoder(P)
    assert decoder.feed(line) == [] and decoder.refused == {why: 1}


@pytest.mark.parametrize("token", [None, TOKEN])
def test_a_client_drives_an_omote_and_another_reads_it(token: str | None) -> None:
    with ExitStack() as closers:
        far, near = Far(closers, kind="line", **({"token": token} if token else {})), CommandState(P)
        keys = {"token": token} if token else {}
        reader = {"kind": "omote-line", "connect": f"tcp:127.0.0.1:{far.port}", **keys}
        open_links([read_link(reader)], LinkContext(near, closers))
        port, stop = free_port(socket.SOCK_DGRAM), threading.Event()
        ends = f"json:127.0.0.1:{port}", f"omote-line:127.0.0.1:{far.port}"
        ready = threading.Event()
        options = Options(stop=stop, token=token)
        thread = threading.Thread(target=translate, args=(*ends, P, options, lambda text: ready.set()), daemon=True)
        thread.start()
        assert ready.wait(10)
        sender = closers.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        (message,) = FORMATS.get("json").encoder(P).encode(part(jawOpen=0.5, headYaw=-0.25))
        opening = f"AUTH {token}\n".encode() if token else b""  # a token is asked for over UDP, too
        out = P.neutral()

        def came() -> bool:
            sender.sendto(opening + message, ("127.0.0.1", port))
            far.state.tick(time.monotonic_ns(), 0.01, out)
            layer = near.mixer["capture"]
            return bool(layer.held[JAW] and np.abs(layer.values[[JAW, YAW]] - (0.5, -0.25)).max() < 1e-3)

        try:
            wait_for(came, limit_s=20.0)
        finally:
            stop.set()
            thread.join(10)


def test_its_port_is_that_of_the_link_of_a_robot_that_omote_runs() -> None:
    assert FORMATS.get("omote-line").port == PORT
