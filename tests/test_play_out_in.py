"""A take that one body plays goes out in every format over loopback, and comes in to another body as it was.

The take's last face stands still, so that the motion limits of the first body let it arrive, however busy the machine.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.body import Body
from controller.formats.format import FORMATS
from controller.stage.stage import load_stage
from controller.takes.plain import write_plain
from tests.controller.formats.faces import KINDS, tolerance
from tests.controller.links.net.sockets import free_port

EXACT = [kind for kind in KINDS if FORMATS.get(kind).carries(P).any()]
FIRST_S, LAST_S = 0.5, 60.0


def faces() -> np.ndarray:
    """(2, P) faces."""
    rng = np.random.default_rng(7)
    return np.round(rng.uniform(np.maximum(P.low, -0.7), 0.7, (2, len(P))), 3)


def write_take(path: Path) -> None:
    first, last = faces()
    times = np.array([0.0, FIRST_S, FIRST_S + 1 / 60, FIRST_S + LAST_S])
    write_plain(path, times, np.array([first, first, last, last]), np.ones(len(P), dtype=bool), P)


def address(kind: str, port: int) -> str:
    transport = next(each for each in FORMATS.get(kind).transports if each in ("udp", "tcp"))
    return f"{transport}:127.0.0.1:{port}"


@contextmanager
def running(path: Path, text: str) -> Iterator[Body]:
    path.write_text(text)
    with Mailbox.create(len(P)) as mailbox:
        body = Body(load_stage(str(path), P), P, mailbox)
        body.start()
        try:
            yield body
        finally:
            body.stop()


@pytest.mark.slow
def test_a_take_goes_out_and_comes_in_through_running_bodies(tmp_path: Path) -> None:
    ports = {kind: free_port(socket.SOCK_DGRAM) for kind in EXACT}
    write_take(tmp_path / "take.csv")
    out = 'name = "out"\ntake = "take.csv"\n' + "".join(
        f'[[links]]\nkind = "{kind}"\nsend = "{address(kind, port)}"\n' for kind, port in ports.items()
    )
    there = 'name = "in"\n' + "".join(
        f'[layers.in_{n}]\npriority = {100 + n}\n[[links]]\nkind = "{kind}"\nlisten = "{address(kind, port)}"\n'
        f'layer = "in_{n}"\neyes = "both"\n'
        for n, (kind, port) in enumerate(ports.items())
    )
    with running(tmp_path / "in.toml", there) as taker:
        taker.begin()
        with running(tmp_path / "out.toml", out) as player:
            player.begin()
            missing, end_s = {*EXACT}, time.monotonic() + LAST_S
            while missing:
                assert time.monotonic() < end_s, f"the face did not come in by {sorted(missing)}"
                missing -= {kind for n, kind in enumerate(EXACT) if came(taker, n, kind, faces()[1])}
                time.sleep(0.02)


def came(body: Body, number: int, kind: str, face: np.ndarray) -> bool:
    """Whether a layer shows a face, as exactly as its format can."""
    form = FORMATS.get(kind)
    layer, carried = body.state.mixer[f"in_{number}"], form.carries(P)
    away = np.abs(layer.values[carried] - face[carried])
    return bool(layer.held[carried].all() and (away <= tolerance(form)).all())


def test_nearly_every_format_is_exact() -> None:
    assert {"livelink", "vmc", "json", "csv", "binary", "osc", "ifacialmocap", "facemotion3d", "midi"} <= {*EXACT}
