"""drivers.servos.port: what is wrong with the bare SDK's port handler, and is not here.

Numbers S5 to S12 as in drivers/dynamixel/sdk.py. Everything runs over real pseudo-terminals.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections.abc import Callable, Iterator

import dynamixel_sdk as bare
import pytest
import serial

from drivers.base.errors import DriverError, PortLost
from drivers.dynamixel.sdk import Packets
from drivers.packets.packet import Instruction, InstructionPacket, encode_status
from drivers.servos.port import POLL_AFTER_S, POLL_BEFORE_S, POLL_INTERVAL_S, SLEEP_PERIOD, Port
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import SERVOS
from tests.drivers.wire import Wire

POSITION = 132
Client = tuple[bare.PortHandler, bare.Protocol2PacketHandler]


@pytest.fixture
def wire() -> Iterator[Wire]:
    with Wire() as far_end:
        yield far_end


@pytest.fixture
def ours(wire: Wire) -> Iterator[tuple[Port, Packets]]:
    port = Port(wire.path, margin_s=0.3)
    port.openPort()
    yield port, Packets()
    port.closePort()


@pytest.fixture
def theirs(wire: Wire) -> Iterator[Client]:
    port = bare.PortHandler(wire.path)
    port.openPort()
    yield port, bare.Protocol2PacketHandler()
    port.ser.close()


def four(value: int) -> bytes:
    return struct.pack("<i", value)


def says(value: int) -> Callable[[InstructionPacket], list[bytes]]:
    """A servo that answers every read with one value."""
    ping = Instruction.PING
    return lambda p: [encode_status(p.id, 0, b"\xb0\x04\x34" if p.instruction == ping else four(value))]


def test_s5_an_interrupt_in_a_transaction_leaves_the_port_usable(
    wire: Wire, ours: tuple, theirs: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    wire.answer = says(7)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    port, packets = theirs
    with monkeypatch.context() as patch:
        patch.setattr(port, "readPort", interrupt)
        with pytest.raises(KeyboardInterrupt):
            packets.read4ByteTxRx(port, 1, POSITION)
    assert packets.read4ByteTxRx(port, 1, POSITION)[1] == bare.COMM_PORT_BUSY
    port.ser.close()

    port, packets = ours
    for broken in ("read", "write", "drain"):
        with monkeypatch.context() as patch:
            patch.setattr(port.link, broken, interrupt)
            with pytest.raises(KeyboardInterrupt):
                packets.read4ByteTxRx(port, 1, POSITION)
        assert not port.is_using
        assert packets.read4ByteTxRx(port, 1, POSITION)[:2] == (7, bare.COMM_SUCCESS)


def test_s6_an_unplugged_port_is_one_error(wire: Wire, ours: tuple, theirs: Client) -> None:
    (their_port, their_packets), (port, packets) = theirs, ours
    wire.unplug()
    with pytest.raises(Exception) as caught:
        their_packets.read4ByteTxRx(their_port, 1, POSITION)
    assert not isinstance(caught.value, (OSError, serial.SerialException)), "termios.error"
    for use in (packets.read4ByteTxRx, packets.hello):
        with pytest.raises(PortLost):
            use(port, 1, POSITION) if use == packets.read4ByteTxRx else use(port, 1)
        assert not port.is_using


def test_s7_a_silent_servo_costs_the_margin_and_not_34_ms(wire: Wire) -> None:
    theirs, port = bare.PortHandler("unused"), Port("/dev/ttyACM0")
    theirs.tx_time_per_byte = 0.01
    theirs.setPacketTimeout(15)
    assert theirs.packet_timeout > 34.0
    port.setPacketTimeout(15)
    assert port.packet_timeout == pytest.approx(0.15 + port.margin_s * 1000)
    assert port.margin_s < 0.02
    assert Port(wire.path).margin_s == 0.05, "a program behind a pseudo-terminal may be busy"


def test_s7_the_latency_timer_sets_the_margin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.port.serialport.latency_s", lambda path: 0.016)
    slow = Port("/dev/ttyUSB0").margin_s
    monkeypatch.setattr("drivers.port.serialport.latency_s", lambda path: 0.001)
    assert slow - Port("/dev/ttyUSB0").margin_s == pytest.approx(0.030)


def test_s8_a_step_of_the_wall_clock_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs, port = bare.PortHandler("unused"), Port("unused")
    theirs.setPacketTimeoutMillis(1000)
    port.setPacketTimeoutMillis(1000)
    future = time.time() + 3600
    monkeypatch.setattr(time, "time", lambda: future)
    assert theirs.isPacketTimeout()
    assert not port.isPacketTimeout()
    assert port.getTimeSinceStart() < 900


def test_s9_a_second_thread_is_told(wire: Wire, ours: tuple, theirs: Client) -> None:
    wire.answer = lambda packet: [(0.3, encode_status(packet.id, 0, four(1)))]
    results: list[object] = []

    def use(port: bare.PortHandler, packets: bare.Protocol2PacketHandler) -> None:
        results.append(packets.read4ByteTxRx(port, 1, POSITION)[1])

    port, packets = ours
    port.margin_s = 2.0
    thread = threading.Thread(target=use, args=(port, packets))
    thread.start()
    while not port.is_using:
        time.sleep(0.001)
    with pytest.raises(DriverError, match="two threads"):
        packets.hello(port, 1)
    thread.join()
    assert results == [bare.COMM_SUCCESS]
    assert not port.is_using


def reads_while_waiting(port: object, name: str, client: Client, monkeypatch: pytest.MonkeyPatch) -> int:
    """How often a client asks for bytes while it waits for one reply that never comes."""
    count, original = 0, getattr(port, name)

    def counted(*args: object) -> bytes:
        nonlocal count
        count += 1
        return original(*args)

    with monkeypatch.context() as patch:
        patch.setattr(port, name, counted)
        assert client[1].read4ByteTxRx(client[0], 1, POSITION)[1] == bare.COMM_RX_TIMEOUT
    return count


def test_s12_waiting_does_not_spin(wire: Wire, ours: tuple, theirs: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    spins = reads_while_waiting(theirs[0], "readPort", theirs, monkeypatch)
    assert spins > 20, "the bare SDK waits without spinning by now"
    theirs[0].ser.close()
    assert reads_while_waiting(ours[0].link, "read", ours, monkeypatch) <= 3


class Waits:
    """Stands for the clock of a port and its far end: a reply is complete at `last_s`; notes sleeps and reads."""

    def __init__(self, port: Port, monkeypatch: pytest.MonkeyPatch, last_s: float, late_s: float = 0.0) -> None:
        self.now, self.last_s, self._late_s = 0.0, last_s, late_s
        self.naps: list[float] = []
        self.asked: list[float] = []
        port.clock, port.sleep = lambda: self.now, self._sleep
        monkeypatch.setattr(port.link, "read", self._read)
        monkeypatch.setattr(port.link, "read_now", lambda: self._read(self.now))
        port.deadline_s = 0.005 + port.margin_s  # a reply takes 5 ms on the wire

    def _sleep(self, seconds: float) -> None:
        self.naps.append(seconds)
        self.now += seconds + self._late_s

    def _read(self, deadline_s: float) -> bytes:
        self.asked.append(deadline_s)
        self.now = max(self.now, min(deadline_s, self.last_s))
        return b"x" if self.now >= self.last_s else b""


@pytest.fixture
def sleeper() -> Port:
    return Port("unused", margin_s=0.05)


def test_a_reply_in_pieces_is_slept_through_and_polled_for_at_first(
    sleeper: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits = Waits(sleeper, monkeypatch, last_s=0.005)
    assert sleeper.more() == b"x"
    assert waits.naps == [pytest.approx(0.005 - POLL_BEFORE_S)]
    assert max(waits.asked) <= waits.last_s + POLL_INTERVAL_S, "so the processor is awake when it comes"
    waits.now, waits.last_s = 0.0048, math.inf
    waits.asked.clear()
    assert sleeper.more() == b""
    assert len(waits.naps) == 1, "a sleep as short as this is none"
    assert waits.now == sleeper.deadline_s
    assert len(waits.asked) <= (0.0002 + POLL_AFTER_S) / POLL_INTERVAL_S + 3, "then it is awaited in one go"


@pytest.mark.parametrize(("late_s", "polls"), [(5e-6, False), (80e-6, True)])
def test_polling_goes_on_only_where_the_system_wakes_the_thread_late(
    sleeper: Port, monkeypatch: pytest.MonkeyPatch, late_s: float, polls: bool
) -> None:
    waits = Waits(sleeper, monkeypatch, 0.005, late_s)
    for _ in range(50):
        waits.now = 0.0
        assert sleeper.more() == b"x"
    assert waits.naps[-1] == pytest.approx(0.005 - POLL_BEFORE_S if polls else 0.005)


@pytest.mark.parametrize(("late_s", "polls"), [(5e-6, False), (80e-6, True)])
def test_it_is_learned_also_from_replies_too_short_to_sleep_before_polling(
    sleeper: Port, monkeypatch: pytest.MonkeyPatch, late_s: float, polls: bool
) -> None:
    """Else a processor that was busy once would be polled on for ever."""
    waits, calls = Waits(sleeper, monkeypatch, 0.005, late_s), 40 * SLEEP_PERIOD
    for _ in range(calls):
        waits.now = 0.0042
        assert sleeper.more() == b"x"
    assert waits.naps == pytest.approx([0.0008] * len(waits.naps))
    assert len(waits.naps) == 40 if polls else len(waits.naps) > calls / 2


def test_the_replies_after_one_in_pieces_are_slept_for_from_their_beginning(
    sleeper: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits = Waits(sleeper, monkeypatch, 0.004)
    assert sleeper.first() == b"x"
    assert not waits.naps, "nothing is known yet: replies of a port without a wire come at once"
    sleeper.more()
    waits.naps.clear()
    for _ in range(SLEEP_PERIOD + 1):
        waits.now = 0.0
        assert sleeper.first() == b"x"
    assert len(waits.naps) == SLEEP_PERIOD, "then one is looked at again"


@pytest.mark.parametrize("baud", [123_456, 250_000, 4_500_000])
def test_any_baud_rate_opens(wire: Wire, baud: int) -> None:
    assert not bare.PortHandler(wire.path).setBaudRate(baud)
    port = Port(wire.path)
    assert port.setBaudRate(baud)
    assert port.getBaudRate() == baud
    assert port.tx_time_per_byte == pytest.approx(10_000 / baud)
    port.closePort()


@pytest.fixture
def port() -> Port:
    return Port(VirtualBus(SERVOS).link, margin_s=0.01)  # type: ignore[arg-type]


def test_a_reply_is_awaited_from_when_all_that_was_sent_has_left(port: Port) -> None:
    port.openPort()
    begin_s = port.clock()
    port.transmit(bytes(100))
    port.transmit(bytes(50))
    port.expect(20)
    assert port.deadline_s - begin_s == pytest.approx(170 * 10 / port.baudrate + 0.01)


def test_opening_forgets_who_owed_an_answer_and_who_was_talking(port: Port) -> None:
    port.openPort()
    port.suspects.add(3)
    port.is_using = True
    with pytest.raises(DriverError, match="two threads"):
        port.is_using = True
    port.openPort()
    assert (port.suspects, port.is_using) == (set(), False)


def test_another_path_is_used_from_the_next_opening_on(port: Port) -> None:
    port.setPortName("elsewhere")
    assert port.link.path == port.port_name == "elsewhere"


def test_a_port_says_whether_it_is_open(wire: Wire) -> None:
    """The makers' programs ask for it, by the SDK's name."""
    port = Port(wire.path, margin_s=0.3)
    assert not port.is_open
    for open_it in (port.openPort, lambda: port.setBaudRate(57_600)):
        assert open_it() and port.is_open
        port.closePort()
        assert not port.is_open
