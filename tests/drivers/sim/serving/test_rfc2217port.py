"""drivers.sim.serving.rfc2217port, with pyserial's client, omote's driver, and clients that keep to nothing."""

from __future__ import annotations

import random
import socket
import time
from collections.abc import Iterator

import pytest
import serial

from drivers.base.errors import PortBusy, PortError
from drivers.packets.packet import Instruction, encode_instruction
from drivers.port.serialport import SerialPort
from drivers.sim import SimulatedBus
from drivers.sim.serving.make_port import make_port

pytestmark = pytest.mark.filterwarnings("ignore:set:DeprecationWarning")  # of pyserial's client

PING = bytes.fromhex("FFFFFD0001030001194E")
PONG = bytes.fromhex("FFFFFD000107005500")


@pytest.fixture
def bus() -> Iterator[SimulatedBus]:
    with SimulatedBus([1], "rfc2217://127.0.0.1:0") as running:
        yield running


def test_pyserials_client_sets_the_rate(bus: SimulatedBus) -> None:
    with serial.serial_for_url(bus.path, baudrate=57_600, timeout=0.3) as port:
        port.write(PING)
        assert port.read(14) == b"", "the servo listens at 1 Mbaud"
        port.timeout = 20
        port.baudrate = 1_000_000
        port.write(PING)
        assert port.read(14)[:9] == PONG
        port.dtr = port.rts = False
        port.reset_input_buffer()
        assert port.cts


def test_bytes_that_mean_something_to_telnet_arrive(bus: SimulatedBus) -> None:
    """255 is telnet's escape, and what the header of every packet begins with."""
    with serial.serial_for_url(bus.path, baudrate=1_000_000, timeout=20) as port:
        port.write(encode_instruction(1, Instruction.WRITE, b"\xd0\0" + bytes((255, 240, 255, 255))))
        assert port.read(11)[8] == 0
        port.write(encode_instruction(1, Instruction.READ, b"\xd0\0\4\0"))
        assert bytes((255, 240, 255, 255)) in port.read(15)


@pytest.mark.slow
def test_omotes_own_port_opens_it_and_clients_come_and_go(bus: SimulatedBus) -> None:
    for _ in range(2):
        port = SerialPort(bus.path, 1_000_000)
        port.open()
        port.write(PING)
        answer, end_s = b"", time.monotonic() + 20
        while len(answer) < 14 and time.monotonic() < end_s:
            answer += port.read(time.monotonic() + 0.1)
        assert answer[:9] == PONG
        port.close()


def test_a_second_server_is_told(bus: SimulatedBus) -> None:
    with pytest.raises(PortBusy), SimulatedBus([1], bus.path):
        pass


def test_a_wrong_address_is_told_with_the_option_of_its_own() -> None:
    with pytest.raises(PortError, match="'rfc2217://nowhere' is not rfc2217://HOST:PORT") as error:
        make_port("rfc2217://nowhere")
    assert error.value.hint == "for example --rfc2217 127.0.0.1:4000"
    with pytest.raises(PortError) as error:
        SerialPort("rfc2217://127.0.0.1:1").open()
    assert "simulate dynamixel --rfc2217 HOST:PORT" in error.value.hint


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise",
    [
        b"\xff\xf0", b"\xff\xfa\x2c\x01", b"\xff\xfa\x2c\x01\xff\xf0", b"\xff\xfa\x2c\x03\x63\xff\xf0",
        b"\xff\xfa" + b"x" * 5000, b"\xff\xfd\x63", random.Random(3).randbytes(2000),
    ],
)  # fmt: skip
def test_a_client_that_talks_nonsense_harms_nobody(bus: SimulatedBus, noise: bytes) -> None:
    host, _, number = bus.path.removeprefix("rfc2217://").partition(":")
    with socket.create_connection((host, int(number)), timeout=20) as client:
        client.sendall(noise)
        time.sleep(0.05)
    with serial.serial_for_url(bus.path, baudrate=1_000_000, timeout=20) as port:
        port.write(PING)
        assert port.read(14)[:9] == PONG
