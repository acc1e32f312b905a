"""drivers.sim.serving.control: command lines and the socket that takes them."""

from __future__ import annotations

import json
import os
import select
import socket
from pathlib import Path

import pytest

from drivers.base.errors import PortBusy, PortError
from drivers.sim.serving.control import MAX_LINE, Commands, ControlSocket, Lines
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo


@pytest.fixture
def chain() -> Chain:
    return Chain([SimulatedServo(1), SimulatedServo(2, "xl320")])


def test_faults_are_set_listed_and_cleared(chain: Chain):
    commands = Commands(chain)
    assert commands.handle("fault mute:1 crc:2:every=3") == "ok"
    assert commands.handle("faults") == "ok mute:1 crc:2:every=3"
    assert commands.handle("clear mute") == "ok"
    assert [fault.kind for fault in chain.faults.active] == ["crc"]
    assert commands.handle("clear") == "ok"
    assert commands.handle("faults") == "ok"


def test_servos_and_a_hand(chain: Chain):
    commands = Commands(chain)
    assert commands.handle("place 1 1500") == "ok"
    answer = commands.handle("servos")
    first, second = json.loads(answer.removeprefix("ok "))
    assert first == {"id": 1, "model": "xl330-m288", "position": 1500, "goal": 2048, "torque": False, "error": 0}
    assert (second["model"], second["position"]) == ("xl320", 512)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("", "there is no command ''"),
        ("fly", "there is no command 'fly'"),
        ("fault mute:x", "'x' is not an id"),
        ("fault 'mute:1", "No closing quotation"),
        ("place 9 5", "no simulated servo has id 9"),
        ("place 1 x", "invalid literal"),
        ("place 1", "not enough values"),
        ("place 1 5000000000", "positions go from -1000000000 to 1000000000 steps"),
        (f"place 1 -1{'0' * 400}", "positions go from"),
        ("fault mute:0-99999999999", "must be 0 to 252"),
        ("fault mute:5-3", "names no id: a range begins with its lower end"),
    ],
)
def test_bad_lines_are_answered_with_the_reason(chain: Chain, line: str, why: str):
    answer = Commands(chain).handle(line)
    assert answer.startswith("error ")
    assert why in answer
    assert "\n" not in answer


def test_lines_from_pieces():
    lines = Lines()
    assert lines.feed(b"fau") == []
    assert lines.feed(b"lts\r\n\n  \nclear\nser") == ["faults", "clear"]
    assert lines.feed(b"vos\n") == ["servos"]
    assert lines.feed(b"x" * (MAX_LINE + 1)) == []
    assert lines.feed(b"faults\n") == ["faults"]


def serve(control: ControlSocket) -> None:
    ready, _, _ = select.select(control.descriptors, [], [], 5)
    control.serve(ready)


def test_clients_come_ask_and_go(tmp_path: Path):
    control = ControlSocket(tmp_path / "s", lambda line: f"ok {line}")
    clients = [socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) for _ in range(2)]
    for client in clients:
        client.connect(str(tmp_path / "s"))
        serve(control)
    for client in clients:
        client.sendall(b"a\nb\n")
        serve(control)
        assert client.recv(99) == b"ok a\nok b\n"
    clients[0].close()
    serve(control)
    assert len(control.descriptors) == 2
    control.close()
    control.close()
    assert clients[1].recv(9) == b""
    clients[1].close()
    assert os.listdir(tmp_path) == []


def test_a_dead_socket_is_replaced_a_living_one_and_a_file_are_not(tmp_path: Path):
    path = tmp_path / "s"
    dead = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    dead.bind(str(path))
    dead.close()
    control = ControlSocket(path, str)
    with pytest.raises(PortBusy, match="another program serves"):
        ControlSocket(path, str)
    control.close()
    path.write_text("data")
    with pytest.raises(PortBusy, match="there is a file"):
        ControlSocket(path, str)
    assert path.read_text() == "data"
    with pytest.raises(PortError, match="cannot make the control socket"):
        ControlSocket(tmp_path / "none" / "s", str)


def test_specs_with_spaces_are_quoted_and_words_may_be(chain: Chain):
    commands = Commands(chain)
    assert commands.handle("fault 'unplug:at=9s:as=/tmp/a b' mute:1") == "ok"
    assert commands.handle("faults") == "ok mute:1"
    chain.faults.advance(float("inf"))
    assert commands.handle("faults") == "ok mute:1 'unplug:at=9s:as=/tmp/a b'"


def test_all_faults_are_cleared_where_no_kind_is_named(chain: Chain):
    commands = Commands(chain)
    commands.handle("fault mute:1 echo crc:1:at=9s")
    assert commands.handle("clear") == "ok"
    assert (chain.faults.active, chain.faults.next_change_s) == ([], float("inf"))


def test_the_hint_of_a_refused_fault_is_given(chain: Chain):
    assert "kinds: alert, baud" in Commands(chain).handle("fault nonsense")


def test_the_longest_line_is_kept():
    lines = Lines()
    assert lines.feed(b"x" * 4096) == []
    assert lines.feed(b"\n") == ["x" * 4096]
    assert lines.feed(b"\xff\n") == ["\ufffd"]


def test_a_socket_that_somebody_removed_is_no_error(tmp_path: Path):
    control = ControlSocket(tmp_path / "s", str)
    (tmp_path / "s").unlink()
    control.close()
    assert control.descriptors[1:] == []
