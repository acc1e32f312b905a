"""Translating takes and streams, and what is told where an end is wrong."""

from __future__ import annotations

import socket
import threading
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.tools.translate import Options, parse_end, translate
from tests.controller.formats.faces import face
from tests.controller.links.net.sockets import free_port

TAKE = "Timecode,JawOpen,MouthSmileLeft\n0:0:0:0,0.1,0.5\n0:0:0:6,0.4,0.25\n0:0:0:12,0.2,0\n"


def test_a_take_is_sent_row_by_row_at_its_own_rate(tmp_path: Path) -> None:
    path = tmp_path / "take.csv"
    path.write_text(TAKE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        counts = translate(str(path), f"livelink:127.0.0.1:{receiver.getsockname()[1]}", P)
        decoder = FORMATS.get("livelink").decoder(P)
        frames = [decoder.feed(receiver.recv(65536))[0] for _ in range(3)]
    assert (counts.frames, counts.sent, counts.dropped, counts.refused) == (3, 3, 0, {})
    np.testing.assert_allclose([frame.values[P.index("jawOpen")] for frame in frames], [0.1, 0.4, 0.2], atol=1e-6)
    np.testing.assert_allclose([frame.time_s for frame in frames], [0.0, 0.1, 0.2], atol=1e-6)


def test_a_mirror_swaps_sides_and_turns() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        port, options = free_port(), Options(mirror=True)
        ends = f"livelink:127.0.0.1:{port}", f"vmc:127.0.0.1:{receiver.getsockname()[1]}"
        ready = threading.Event()
        thread = threading.Thread(target=translate, args=(*ends, P, options, lambda text: ready.set()))
        thread.start()
        try:
            assert ready.wait(10)
            sent = face(4, 1.0)
            for message in FORMATS.get("livelink").encoder(P).encode(sent):
                receiver.sendto(message, ("127.0.0.1", port))
            (frame,) = FORMATS.get("vmc").decoder(P).feed(receiver.recv(65536))
        finally:
            options.stop.set()
            thread.join(10)
    found, given = frame.values, sent.values
    assert found[P.index("mouthSmileLeft")] == pytest.approx(given[P.index("mouthSmileRight")], abs=1e-5)
    assert found[P.index("leftEyeYaw")] == pytest.approx(-given[P.index("rightEyeYaw")], abs=1e-5)
    assert found[P.index("headPitch")] == pytest.approx(given[P.index("headPitch")], abs=1e-5)


@pytest.mark.parametrize(
    ("source", "target", "told"),
    [
        ("livelnk:127.0.0.1:1", "vmc", "unknown format 'livelnk', did you mean 'livelink'"),
        ("livelink", "vmc:127.0.0.1:0", "is not HOST:PORT"),
        ("livelink:0.0.0.0:1", "vmc", "every machine that reaches this one could send faces there"),
        ("none.csv", "vmc", "none.csv: "),
    ],
)
def test_an_end_that_is_wrong_is_told_with_what_to_type(source: str, target: str, told: str) -> None:
    with pytest.raises(ControllerError) as error:
        translate(source, target, P)
    assert told in str(error.value) and error.value.hint


@pytest.mark.parametrize(
    ("source", "token", "said"),
    [("livelink", None, "without a password"), ("json:tcp", "abcdefghijkl", "with the token")],
)
def test_what_is_opened_to_others_is_said(source: str, token: str | None, said: str) -> None:
    told: list[str] = []
    options = Options(open_to_network=True, token=token, seconds=0.1)
    kind = socket.SOCK_STREAM if "tcp" in source else socket.SOCK_DGRAM
    translate(f"{source}:0.0.0.0:{free_port(kind)}", "vmc", P, options, told.append)
    assert "every machine that reaches" in told[0] and said in told[0]
    translate(f"{source}:127.0.0.1:{free_port(kind)}", "vmc", P, options, told.append)
    assert "every machine" not in told[1]


def test_an_address_may_be_left_out() -> None:
    form, address = parse_end("vmc")
    assert (form.kind, str(address)) == ("vmc", "udp:127.0.0.1:39539")
