"""docs/links.md, the matrix: a face goes from every format to every other, through omote translate, over loopback."""

from __future__ import annotations

import socket
import threading
from itertools import product

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS, Format
from controller.formats.frame import Frame, Splitter
from controller.tools.translate import Counts, Options, translate
from tests.controller.formats.faces import KINDS, face, tolerance
from tests.controller.links.net.sockets import free_port

FRAMES = 6


def kind_of_socket(form: Format) -> socket.SocketKind:
    return socket.SOCK_DGRAM if transport(form) == "udp" else socket.SOCK_STREAM


def transport(form: Format) -> str:
    """How it travels over a network if nobody chooses."""
    return next(each for each in form.transports if each in ("udp", "tcp"))


class Translator:
    """``omote translate`` in a thread, with a sender before it and a receiver behind it."""

    def __init__(self, source: Format, target: Format) -> None:
        self._target = target
        self._receiver = socket.socket(socket.AF_INET, kind_of_socket(target))
        self._receiver.bind(("127.0.0.1", 0))
        self._receiver.settimeout(10)
        if kind_of_socket(target) == socket.SOCK_STREAM:
            self._receiver.listen(1)
        self._port = free_port(kind_of_socket(source))
        self._sender = socket.socket(socket.AF_INET, kind_of_socket(source))
        self._ready = threading.Event()
        ends = f"{source.kind}:127.0.0.1:{self._port}", f"{target.kind}:127.0.0.1:{self._receiver.getsockname()[1]}"
        self._stop = threading.Event()
        self.counts: Counts | None = None
        self._thread = threading.Thread(target=self._run, args=ends, daemon=True)
        self._thread.start()
        assert self._ready.wait(10)
        self._sender.connect(("127.0.0.1", self._port))
        self._encoder, self._delimiter = source.encoder(P), source.delimiter
        self._call: socket.socket | None = None
        self._decoder = target.decoder(P)
        self._splitter = Splitter(target.delimiter or b"\n", target.most, self._decoder.refused)

    def _run(self, source: str, target: str) -> None:
        self.counts = translate(source, target, P, Options(stop=self._stop), lambda text: self._ready.set())

    def pass_on(self, frame: Frame) -> Frame:
        """Send one frame and wait for what arrives."""
        for message in self._encoder.encode(frame):
            self._sender.sendall(message + (self._delimiter if self._sender.type == socket.SOCK_STREAM else b""))
        found: list[Frame] = []
        while not found:
            found = [each for message in self._messages() for each in self._decoder.feed(message)]
        return found[-1]

    def _messages(self) -> list[bytes]:
        if self._receiver.type == socket.SOCK_DGRAM:
            return [self._receiver.recv(65536)]
        if self._call is None:
            self._call, _ = self._receiver.accept()
            self._call.settimeout(10)
        return self._splitter.feed(self._call.recv(65536))

    def close(self) -> None:
        for each in (self._sender, self._receiver, self._call):
            if each is not None:
                each.close()
        self._stop.set()
        self._thread.join(10)


@pytest.mark.slow
@pytest.mark.parametrize(("source", "target"), list(product(KINDS, KINDS)))
def test_a_face_goes_from_one_format_to_another(source: str, target: str) -> None:
    one, other = FORMATS.get(source), FORMATS.get(target)
    both = one.carries(P) & other.carries(P)
    translator = Translator(one, other)
    try:
        for seed in range(FRAMES):
            sent = face(seed, 1.0 + seed / 60)
            found = translator.pass_on(sent)
            assert found.mask[both].all() and found.mask.any()
            atol = tolerance(one) + tolerance(other)
            np.testing.assert_allclose(found.values[both], sent.values[both], atol=atol)
    finally:
        translator.close()
    assert translator.counts is not None and translator.counts.frames == FRAMES
