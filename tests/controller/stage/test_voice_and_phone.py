"""The shipped stage in which a voice has the lips and a phone the rest of the face."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import open_links
from controller.stage.stage import load_stage
from tests.controller.links.net.sockets import free_port, wait_for

BROW, JAW, SMILE = P.index("browInnerUp"), P.index("jawOpen"), P.index("mouthSmileLeft")


@pytest.fixture
def state() -> Iterator[CommandState]:
    """The stage's layers, with a phone that shows raised brows and a smile, and a closed mouth."""
    stage = load_stage("voice-and-phone", P)
    state, port, values = stage.state(P), free_port(), P.neutral()
    values[[BROW, SMILE]] = 0.8, 0.6
    (link,) = stage.settings.links
    link = link.model_copy(update={"listen": f"127.0.0.1:{port}", "timeout_s": 60.0})
    with ExitStack() as closers, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as phone:
        open_links([link], LinkContext(state, closers))
        for message in FORMATS.get("livelink").encoder(P).encode(Frame(values, np.ones(len(P), dtype=bool), 0.0)):
            phone.sendto(message, ("127.0.0.1", port))
        wait_for(lambda: state.mixer["phone"].holding)
        yield state


def shown(state: CommandState, viseme: str | None) -> np.ndarray:
    """The face after a second in which the mouth forms a viseme; the phone goes on."""
    out, phone = P.neutral(), state.mixer["phone"]
    values, mask = phone.values.copy(), np.ones(len(P), dtype=bool)
    for n in range(100):
        now_ns = 10**12 + n * 10_000_000
        state.write_layer("phone", values, mask, now_ns)
        if viseme is not None:
            state.viseme([viseme], [1.0], now_ns)
        state.tick(now_ns, 0.01, out)
    return out


def test_the_voice_opens_the_jaw_and_the_phone_raises_the_brows(state: CommandState) -> None:
    face = shown(state, "aa")
    assert face[BROW] == pytest.approx(0.8, abs=0.05) and face[JAW] > 0.2
    assert state.holder(JAW) == "speech" and state.holder(BROW) == "phone"
    assert 0.1 < face[SMILE] < 0.6  # it shows through the speaking mouth


def test_without_a_voice_the_phone_has_all_of_the_face(state: CommandState) -> None:
    face = shown(state, None)
    assert face[JAW] == pytest.approx(0.0, abs=0.05) and face[SMILE] == pytest.approx(0.6, abs=0.05)
    assert state.holder(JAW) == "phone"
