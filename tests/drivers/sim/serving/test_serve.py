"""drivers.sim.serving.serve: serving until told to stop."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial

from drivers.base.errors import DriverError
from drivers.packets.packet import Instruction as I
from drivers.packets.packet import StatusReader, encode_instruction
from drivers.port.serialport import SerialPort
from drivers.sim.serving import serve as serving
from drivers.sim.serving.serve import EARLY_S, POLL_STEP_S, SPARE_S, PortServer, make_server, serve, serve_dynamixel
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.simulators import ids_and_models
from drivers.sim.wire.line import PAUSE_S


def test_it_calls_back_serves_and_cleans_up(tmp_path: Path, capsys):
    link, ready = tmp_path / "bus", threading.Event()
    paths: list[str] = []
    reading, writing = os.pipe()

    def on_ready(path: str) -> None:
        paths.append(path)
        ready.set()

    thread = threading.Thread(
        target=serve_dynamixel,
        args=([3, 4], "xm430-w350", 57_600, link, False, ["alert:4"], on_ready),
        kwargs={"stop": reading},
    )
    thread.start()
    try:
        assert ready.wait(30)
        client = os.open(paths[0], os.O_RDWR | os.O_NOCTTY)
        os.write(client, encode_instruction(0xFE, I.PING))
        received = b""
        while len(received) < 28:
            assert select.select([client], [], [], 5)[0]
            received += os.read(client, 99)
        os.close(client)
    finally:
        os.close(writing)
        thread.join(30)
        os.close(reading)
    assert [(r.id, r.error, r.params[:2]) for r in StatusReader().feed(received)] == [
        (3, 0, b"\xfc\x03"),
        (4, 0x80, b"\xfc\x03"),
    ]
    assert paths == [str(link)]
    assert not link.is_symlink()
    assert capsys.readouterr() == ("", "")


def test_an_interrupt_ends_it_and_takes_the_link_away(tmp_path: Path):
    def interrupt(path: str) -> None:
        assert Path(path).is_symlink()
        raise KeyboardInterrupt

    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(KeyboardInterrupt):
        serve_dynamixel([1], link=tmp_path / "bus", on_ready=interrupt)
    assert os.listdir(tmp_path) == []
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize("options", [{"model": "nonsense"}, {"faults": ["nonsense"]}])
def test_bad_settings_are_refused_before_anybody_is_told(tmp_path: Path, options: dict):
    with pytest.raises(DriverError, match="nonsense"):
        serve_dynamixel([1], link=tmp_path / "bus", on_ready=lambda path: pytest.fail("too early"), **options)
    assert os.listdir(tmp_path) == []


def test_the_loop_sleeps_until_something_is_due():
    chain = Chain([SimulatedServo(1)])
    server = PortServer(chain)
    try:
        assert server._timeout() is None  # at rest nothing wakes it but its descriptors
        chain.faults.add(["mute:1:at=60s"], time.monotonic())
        assert 59 < server._timeout() <= 60
        chain.faults.clear(None, 0.0)
        server._queue.receive(b"\xff\xff\xfd\x00", time.monotonic())
        assert 0 < server._timeout() <= PAUSE_S
    finally:
        server.port.close()


def test_servos_from_ids_and_from_specs():
    class Spec:
        id, model = 7, "xl320"

    assert ids_and_models([2, Spec()], "xm430-w210") == [(2, "xm430-w210"), (7, "xl320")]


def test_another_program_sets_faults_through_the_socket(tmp_path: Path):
    path, paths, ready = tmp_path / "control", [], threading.Event()
    reading, writing = os.pipe()
    thread = threading.Thread(
        target=serve_dynamixel,
        args=([1],),
        kwargs={"commands": path, "stop": reading, "on_ready": lambda p: (paths.append(p), ready.set())},
    )
    thread.start()
    try:
        assert ready.wait(30)
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.connect(str(path))
            client.settimeout(5)
            client.sendall(b"fault alert:1\n")
            assert client.recv(99) == b"ok\n"
            with serial.Serial(paths[0], 1_000_000, timeout=10) as port:
                port.write(encode_instruction(1, I.PING))
                assert StatusReader().feed(port.read(14))[0].alert
    finally:
        os.close(writing)
        thread.join(30)
        os.close(reading)
    assert not path.exists()


def test_a_port_that_cannot_be_made_leaves_no_socket(tmp_path: Path):
    with pytest.raises(DriverError, match="cannot make the link"):
        serve_dynamixel([1], link=tmp_path / "none" / "port", commands=tmp_path / "control")
    assert os.listdir(tmp_path) == []


def test_what_passes_is_shown_and_any_byte_ends_a_server_without_commands():
    server, seen = PortServer(Chain([SimulatedServo(1)]), "memory://shown"), []
    server.tap = lambda sent, data: seen.append((sent, len(data)))
    ours, theirs = socket.socketpair()
    thread = threading.Thread(target=server.run, args=(ours,))
    thread.start()
    port = SerialPort("memory://shown")
    port.open()
    port.write(encode_instruction(1, I.PING))
    data = b""
    while len(data) < 14:
        data += port.read(time.monotonic() + 60)
    port.close()
    theirs.sendall(b"x")
    thread.join(30)
    assert not thread.is_alive()
    assert (seen[0], sum(size for sent, size in seen if not sent)) == ((True, 10), 14)
    assert not server.port.is_open
    server.close()
    ours.close()
    theirs.close()


def test_commands_come_by_lines_until_their_end():
    lines: list[str] = []
    server = PortServer(Chain([SimulatedServo(1)]), "memory://lines", on_line=lines.append)
    ours, theirs = socket.socketpair()
    theirs.sendall(b"one\ntw")
    theirs.sendall(b"o\nrest")
    theirs.close()
    server.run(ours)
    assert lines == ["one", "two"]
    ours.close()


def test_an_unplug_drops_what_is_under_way_and_comes_back_where_it_was():
    chain = Chain([SimulatedServo(1)])
    server = PortServer(chain, "memory://plug")
    server._queue.receive(encode_instruction(1, I.PING) + b"\xff\xff", 1.0)
    assert server._queue.replies and chain.reader.pending
    chain.faults.add(["unplug"], 1.0)
    assert (server.port.is_open, list(server._queue.replies), chain.reader.pending) == (False, [], 0)
    chain.faults.clear("unplug", 2.0)
    assert (server.port.is_open, server.port.path) == (True, "memory://plug")
    server.close()


def test_a_server_wakes_early_for_a_reply_and_polls_after_it():
    server = PortServer(Chain([SimulatedServo(1)]), "memory://early", wire=True)
    now_s = time.monotonic()
    server._queue.replies.append((now_s + 60.0, b"x"))
    assert 59.0 < server._timeout() <= 60.0 - EARLY_S
    server._queue.replies.clear()
    server._prompt, server._replied_s = True, time.monotonic() + 60.0
    assert server._timeout() == POLL_STEP_S
    server._prompt = False
    assert server._timeout() is None
    server.close()


def test_a_server_that_is_woken_on_time_wakes_later_and_no_longer_polls():
    server = PortServer(Chain([SimulatedServo(1)]), "memory://prompt", wire=True)
    for _ in range(100):
        server._note_wake(5e-6)
    server._queue.replies.append((time.monotonic() + 60.0, b"x"))
    assert 60.0 - EARLY_S < server._timeout() + (early_s := server._usual.late_s + SPARE_S) <= 60.0
    assert early_s < 0.5 * EARLY_S
    server._queue.replies.clear()
    server._prompt, server._replied_s = True, time.monotonic() + 60.0
    assert server._timeout() is None
    for _ in range(1000):
        server._note_wake(70e-6)
    assert server._timeout() == POLL_STEP_S
    server.close()


def test_settings_of_a_server_reach_its_line_and_its_wire():
    settings = {"servos": [(1, "xl320")], "link": "memory://made", "baud": 57_600, "faults": ["mute:1"], "seed": 5,
                "wire": True, "latency_s": 0.016, "family": "dynamixel", "options": {}}  # fmt: skip
    server = make_server(settings)
    assert [servo.baud for servo in server.line.servos] == [57_600]
    assert server._queue._timing.latency_s == 0.016
    assert server._queue._baud == 57_600
    assert server.on_line("faults") == "ok mute:1"
    server.close()
    server = make_server(settings | {"wire": False})
    assert server._queue._timing is None
    server.close()
    with pytest.raises(DriverError, match="nonsense"):
        make_server(settings | {"faults": ["nonsense"]})
    make_server(settings).close()  # the name is free again


@pytest.mark.parametrize(("wire", "age_s", "polls"), [(True, 7e-4, True), (False, 7e-4, False), (True, 9e-4, False)])
def test_a_server_polls_for_a_client_that_writes_at_once_on_a_wire_that_takes_time(wire, age_s, polls, monkeypatch):
    server = PortServer(Chain([SimulatedServo(1)]), "memory://polls", wire=wire)
    port = SerialPort("memory://polls")
    port.open()
    try:
        port.write(b"\xff")
        server._receive()  # accepts the client
        end, now_s = time.monotonic() + 60, time.monotonic()
        while not server.line.reader.pending and time.monotonic() < end:
            with monkeypatch.context() as patch:  # a clock that no slow machine moves
                patch.setattr(serving, "time", SimpleNamespace(monotonic=lambda: now_s))
                server._replied_s = now_s - age_s
                server._receive()
        assert server.line.reader.pending == 1
        assert (server._prompt, server._replied_s) == (polls, 0.0)
    finally:
        port.close()
        server.close()


def test_the_server_is_shown_before_clients_may_come():
    reading, writing = os.pipe()
    os.close(writing)
    calls: list[str] = []
    serve(
        Chain([SimulatedServo(1)]),
        "memory://order",
        lambda path: calls.append(path),
        stop=reading,
        on_server=lambda server: calls.append(type(server).__name__),
    )
    os.close(reading)
    assert calls == ["PortServer", "memory://order"]
