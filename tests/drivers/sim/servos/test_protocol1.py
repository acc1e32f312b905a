"""drivers.sim.servos.protocol1: Protocol 1.0 servos, AX and MX, Feetech STS and SCS, on a wire without a port."""

from __future__ import annotations

import pytest
import serial
from dynamixel_sdk import GroupSyncWrite, PacketHandler, PortHandler

from drivers.packets.packet1 import BROADCAST_ID, Error1, Packet1, Reader1, encode
from drivers.packets.packet1 import Instruction1 as I
from drivers.sim import SimulatedBus
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.plant import Skin
from drivers.sim.wire.simulator import make_line

pytestmark = pytest.mark.usefixtures("patient_sdk")

NO_LOAD = Skin(spring=0.0, inertia=0.0, friction=0.0)


def chain(model: str = "ax-12a", ids: tuple[int, ...] = (1, 2, 3), faults: tuple[str, ...] = ()) -> Chain:
    return Chain([SimulatedServo(i, model, skin=NO_LOAD) for i in ids], faults=faults)


def ask(bus: Chain, device: int, code: int, params: bytes | str = b"", now_s: float = 0.0) -> list[Packet1]:
    body = bytes.fromhex(params) if isinstance(params, str) else params
    data = b"".join(reply.data for reply in bus.feed(encode(device, code, body), now_s))
    return Reader1().feed(data)


def word(value: int) -> bytes:
    return value.to_bytes(2, "little")


def test_ping_of_the_vendor_byte_by_byte():
    bus = chain()
    (reply,) = bus.feed(bytes.fromhex("FF FF 01 02 01 FB"), 0.0)
    assert reply.data == bytes.fromhex("FF FF 01 02 00 FC")
    assert [packet.id for packet in ask(bus, BROADCAST_ID, I.PING)] == [1, 2, 3]
    assert ask(bus, 9, I.PING) == []


def test_read_temperature_of_the_vendor():
    bus = chain(ids=(1,))
    bus.servo(1).plant.forced_c = 32.0
    bus.servo(1).update(0.0)
    (reply,) = bus.feed(bytes.fromhex("FF FF 01 04 02 2B 01 CC"), 1.0)
    assert reply.data == bytes.fromhex("FF FF 01 03 00 20 DB")


def test_write_moves_and_speed_has_its_direction_in_bit_10():
    bus = chain()
    assert ask(bus, 1, I.WRITE, b"\x18\x01") == [Packet1(1, 0, b"")]
    assert ask(bus, 1, I.WRITE, b"\x1e" + word(300) + word(200)) == [Packet1(1, 0, b"")]
    assert ask(bus, 1, I.READ, b"\x26\x02", 0.2) == [Packet1(1, 0, word(200 | 1024))]
    assert ask(bus, 1, I.READ, b"\x2e\x01", 0.2) == [Packet1(1, 0, b"\x01")]
    assert ask(bus, 1, I.READ, b"\x24\x02", 5.0) == [Packet1(1, 0, word(300))]


@pytest.mark.parametrize(
    ("code", "params", "flags"),
    [
        (I.WRITE, b"\x1e" + word(1024), Error1.RANGE),
        (I.WRITE, b"\x24" + word(0), Error1.RANGE),
        (I.WRITE, b"\x1e", Error1.RANGE),
        (I.READ, b"\x00", Error1.RANGE),
        (I.READ, b"\x30\x09", Error1.RANGE),
        (I.ACTION, b"", Error1.INSTRUCTION),
        (I.REG_WRITE, b"\x1e", Error1.RANGE),
        (I.REBOOT, b"", Error1.INSTRUCTION),
        (0x33, b"", Error1.INSTRUCTION),
    ],
)
def test_ax_tells_why_it_refuses_and_feetech_does_not(code: int, params: bytes, flags: Error1):
    assert ask(chain("ax-12a"), 1, code, params) == [Packet1(1, flags, b"")]
    if params[:1] not in (b"\x1e", b"\x24", b"\x30"):
        assert ask(chain("sts3215"), 1, code, params) == [Packet1(1, 0, b"")]


def test_goal_outside_the_angle_limits():
    bus = chain()
    ask(bus, 1, I.WRITE, b"\x08" + word(600))
    assert ask(bus, 1, I.WRITE, b"\x1e" + word(700)) == [Packet1(1, Error1.ANGLE_LIMIT, b"")]


def test_wheel_mode_when_both_limits_are_zero():
    bus = chain()
    ask(bus, 1, I.WRITE, b"\x06" + word(0) + word(0))
    ask(bus, 1, I.WRITE, b"\x18\x01")
    ask(bus, 1, I.WRITE, b"\x20" + word(1023 | 1024))
    servo = bus.servo(1)
    assert servo.plant.motion(1.0).velocity == pytest.approx(-servo.plant.top_speed)


def test_registered_write_action_and_sync_write():
    bus = chain()
    assert ask(bus, 1, I.REG_WRITE, "1E F4 01") == [Packet1(1, 0, b"")]
    assert ask(bus, 1, I.READ, b"\x2c\x01") == [Packet1(1, 0, b"\x01")]
    assert ask(bus, BROADCAST_ID, I.ACTION) == []
    assert bus.servo(1).goal == 500
    assert ask(bus, BROADCAST_ID, I.SYNC_WRITE, "1E 04 01 10 00 50 01 02 20 02 60 03 03 11") == []
    assert [servo.goal for servo in bus.servos] == [0x10, 0x220, 512]


def test_broadcast_write_and_status_levels():
    bus = chain()
    assert ask(bus, BROADCAST_ID, I.WRITE, b"\x19\x01") == []
    assert [servo.register("LED", 0.0) for servo in bus.servos] == [1, 1, 1]
    for level, answered in ((1, [True, True, False]), (0, [True, False, False])):
        ask(bus, 1, I.WRITE, b"\x10" + bytes((level,)))
        got = [ask(bus, 1, I.PING), ask(bus, 1, I.READ, b"\x19\x01"), ask(bus, 1, I.WRITE, b"\x19\x01")]
        assert [bool(replies) for replies in got] == answered


def test_lock_closes_the_eeprom_and_only_a_power_cycle_opens_it():
    bus = chain("mx1-28")
    ask(bus, 1, I.WRITE, b"\x18\x01")
    assert ask(bus, 1, I.WRITE, b"\x05\x00") == [Packet1(1, 0, b"")]  # torque does not lock it
    ask(bus, 1, I.WRITE, b"\x2f\x01")
    assert ask(bus, 1, I.WRITE, b"\x05\x01") == [Packet1(1, Error1.RANGE, b"")]
    ask(bus, 1, I.WRITE, b"\x2f\x00")
    assert bus.servo(1).register("Lock", 0.0) == 1
    assert ask(bus, 1, I.REBOOT) == [Packet1(1, 0, b"")]
    assert ask(bus, 1, I.WRITE, b"\x05\x01", 1.0) == [Packet1(1, 0, b"")]


def test_a_servo_without_supply_hears_nothing_and_starts_anew_when_it_is_back():
    bus = chain("sts3215")
    ask(bus, 1, I.WRITE, b"\x0d\x41")  # Temperature Limit 65 while Lock is 1
    ask(bus, 1, I.WRITE, b"\x28\x01")
    bus.faults.add(["volts:1:2"], 1.0)
    bus.catch_up(1.0)
    assert ask(bus, 1, I.PING, now_s=2.0) == []
    assert not bus.servo(1).torque
    bus.faults.clear("volts", 2.0)
    bus.catch_up(2.0)
    assert ask(bus, 1, I.PING, now_s=2.1) == []
    assert ask(bus, 1, I.PING, now_s=2.3) == [Packet1(1, 0, b"")]
    assert bus.servo(1).register("Temperature Limit", 2.3) == 70
    assert not bus.servo(1).hardware_error


def test_factory_reset_of_dynamixel_takes_the_id_too():
    bus = chain(ids=(9,))
    assert ask(bus, 9, I.FACTORY_RESET) == [Packet1(9, 0, b"")]
    assert bus.servos[0].id == 1
    feetech = chain("sts3215", (9,))
    ask(feetech, 9, I.FACTORY_RESET)
    assert feetech.servos[0].id == 9


def test_overload_limps_until_torque_is_switched_on_again():
    bus = chain(ids=(1,), faults=("hw:1:0x24:at=1s",))
    ask(bus, 1, I.WRITE, b"\x18\x01")
    assert ask(bus, 1, I.READ, b"\x22\x02", 2.0) == [Packet1(1, Error1.OVERLOAD | Error1.OVERHEATING, word(0))]
    assert not bus.servo(1).torque
    assert ask(bus, 1, I.WRITE, b"\x18\x01", 3.0) == [Packet1(1, 0, b"")]
    assert bus.servo(1).torque
    assert bus.servo(1).register("Torque Limit", 3.0) == 1023


def test_bulk_read_is_for_mx_and_answers_an_id_once():
    request = "00 02 01 1E 02 02 24 01 01 03"
    assert ask(chain("mx1-28"), BROADCAST_ID, I.BULK_READ, request) == [
        Packet1(1, 0, word(2048)),
        Packet1(2, 0, word(2048)),
    ]
    assert ask(chain("ax-12a"), BROADCAST_ID, I.BULK_READ, request) == []
    assert ask(chain("mx1-28"), BROADCAST_ID, I.BULK_READ, "00 02 01") == []
    assert ask(chain("mx1-28"), 1, I.BULK_READ, request) == []


def test_sync_read_is_feetechs_and_goes_on_behind_a_gap():
    bus = chain("sts3215")
    assert ask(bus, BROADCAST_ID, I.SYNC_READ, "38 02 03 09 01") == [
        Packet1(3, 0, word(2048)),
        Packet1(1, 0, word(2048)),
    ]
    stopped = chain("sts3215", faults=("chain-stop",))
    assert [packet.id for packet in ask(stopped, BROADCAST_ID, I.SYNC_READ, "38 02 03 09 01")] == [3]
    assert ask(chain("ax-12a"), BROADCAST_ID, I.SYNC_READ, "24 02 01") == []
    assert ask(bus, 1, I.SYNC_READ, "38 02 01") == []


def test_sts_moves_with_sign_bits_and_acceleration():
    bus = chain("sts3215", (1,))
    ask(bus, 1, I.WRITE, b"\x28\x01")
    ask(bus, 1, I.WRITE, b"\x29\x0a" + word(1048) + word(0) + word(500))  # 1000 steps/s2, 500 steps/s
    assert ask(bus, 1, I.READ, b"\x3a\x02", 0.25)[0].params == word(250 | 1 << 15)
    assert ask(bus, 1, I.READ, b"\x3a\x02", 1.0)[0].params == word(500 | 1 << 15)
    assert ask(bus, 1, I.READ, b"\x38\x02", 2.6)[0].params == word(1048)
    assert ask(bus, 1, I.READ, b"\x42\x01", 2.6)[0].params == b"\x00"
    assert ask(bus, 1, I.READ, b"\x47\x02", 2.6)[0].params == word(1048)


@pytest.mark.parametrize(
    ("mode", "register", "value", "speed"), [(1, 46, 700, 700), (1, 46, 300 | 1 << 15, -300), (2, 44, 500, 1700)]
)
def test_sts_speed_and_pwm_modes(mode: int, register: int, value: int, speed: float):
    bus = chain("sts3215", (1,))
    ask(bus, 1, I.WRITE, b"\x37\x00")
    ask(bus, 1, I.WRITE, b"\x21" + bytes((mode,)))
    ask(bus, 1, I.WRITE, b"\x28\x01")
    ask(bus, 1, I.WRITE, bytes((register,)) + word(value))
    assert bus.servo(1).plant.motion(3.0).velocity == pytest.approx(speed)


def test_sts_step_mode_adds_up():
    bus = chain("sts3215", (1,))
    ask(bus, 1, I.WRITE, b"\x37\x00")
    ask(bus, 1, I.WRITE, b"\x21\x03")
    ask(bus, 1, I.WRITE, b"\x28\x01")
    before = bus.servo(1).plant.motion(5.0).position
    ask(bus, 1, I.WRITE, b"\x2a" + word(100), 5.0)
    ask(bus, 1, I.WRITE, b"\x2a" + word(100), 10.0)
    assert bus.servo(1).plant.motion(20.0).position - before == 200


def test_scs_sends_the_high_byte_first_and_keeps_its_time():
    bus = chain("scs0009", (1,))
    assert ask(bus, 1, I.READ, b"\x03\x02")[0].params == bytes.fromhex("0504")
    ask(bus, 1, I.WRITE, b"\x28\x01")
    ask(bus, 1, I.WRITE, b"\x2a" + bytes.fromhex("0264 03E8 0000"))  # 612 in 1000 ms
    assert ask(bus, 1, I.READ, b"\x38\x02", 0.5)[0].params == bytes.fromhex("0232")
    assert ask(bus, 1, I.READ, b"\x38\x02", 1.1)[0].params == bytes.fromhex("0264")


def test_a_write_to_locked_feetech_eeprom_acts_until_the_supply_was_off():
    bus = chain("sts3215", (1,))
    one = bus.servo(1)
    ask(bus, 1, I.WRITE, b"\x05\x09")  # Lock is 1
    ask(bus, 9, I.WRITE, b"\x1f" + word(100))
    assert (one.id, one.registers.get("Homing Offset"), dict(one.eeprom_writes)) == (9, 100, {})
    one.reboot(1.0)
    assert (one.id, one.registers.get("Homing Offset")) == (1, 0)
    assert ask(bus, 1, I.PING, b"", 2.0) == [Packet1(1, 0, b"")]


def test_a_write_to_open_feetech_eeprom_is_kept():
    bus = chain("sts3215", (1,))
    one = bus.servo(1)
    ask(bus, 1, I.WRITE, b"\x1f" + word(100))
    ask(bus, 1, I.WRITE, b"\x37\x00")
    ask(bus, 1, I.WRITE, b"\x05\x09")
    ask(bus, 9, I.WRITE, b"\x37\x01")
    one.reboot(1.0)
    assert (one.id, one.registers.get("Homing Offset")) == (9, 0)
    assert dict(one.eeprom_writes) == {"ID": 1}


@pytest.mark.parametrize(("model", "first", "last"), [("sts3215", 80, 86), ("scs0009", 78, 83)])
def test_the_last_registers_of_feetech_are_read_and_written(model: str, first: int, last: int):
    bus = chain(model, (1,))
    data = bytes(range(1, last - first + 2))
    ask(bus, 1, I.WRITE, bytes((first,)) + data)
    assert ask(bus, 1, I.READ, bytes((first, len(data)))) == [Packet1(1, 0, data)]


def test_feetech_offset_and_calibration():
    bus = chain("sts3215", (1,))
    ask(bus, 1, I.WRITE, b"\x37\x00")
    ask(bus, 1, I.WRITE, b"\x1f" + word(100 | 1 << 11))  # -100
    assert ask(bus, 1, I.READ, b"\x38\x02")[0].params == word(2148)
    bus.servo(1).place(1000, 0.0)
    ask(bus, 1, I.WRITE, b"\x28\x80")
    assert ask(bus, 1, I.READ, b"\x38\x02")[0].params == word(2048)
    assert not bus.servo(1).torque
    assert ask(bus, 1, I.READ, b"\x28\x01")[0].params == b"\x00"


def test_feetech_response_level_and_hardware_errors():
    bus = chain("sts3215", (1,), faults=("hw:1:0x20", "alert:1"))
    ask(bus, 1, I.WRITE, b"\x37\x00")
    assert ask(bus, 1, I.READ, b"\x41\x01") == [Packet1(1, 0x21, b"\x20")]
    ask(bus, 1, I.WRITE, b"\x08\x00")
    assert ask(bus, 1, I.WRITE, b"\x29\x01") == []
    assert len(ask(bus, 1, I.READ, b"\x41\x01")) == 1


def test_reply_faults_speak_protocol_1():
    assert ask(chain(faults=("short:1:1",)), 1, I.READ, b"\x1e\x02") == [Packet1(1, 0, b"\x00")]
    assert ask(chain(faults=("wrongid:1:7",)), 1, I.PING) == [Packet1(7, 0, b"")]
    assert ask(chain(faults=("crc:1",)), 1, I.PING) == []


def test_clocks_may_differ_by_three_percent():
    bus = Chain([SimulatedServo(1, "ax-12a", baud=115_200)])
    assert bus.servo(1).baud == 117_647
    bus.set_line_baud(115_200)
    assert len(ask(bus, 1, I.PING)) == 1
    bus.set_line_baud(57_600)
    assert ask(bus, 1, I.PING) == []


@pytest.mark.parametrize("params", [b"", b"\x1e\xff\xff"])
def test_size_on_the_wire(params: bytes):
    bus, frame = chain(), encode(1, I.WRITE, params)
    (packet,) = bus.reader.feed(frame)
    assert bus.size(packet) == len(frame)


def test_scs_knows_no_sync_read():
    assert ask(chain("scs0009"), BROADCAST_ID, I.SYNC_READ, "38 02 01") == []


def test_the_models_decide_the_protocol():
    def protocols(*servos: tuple[int, str]) -> list[int]:
        return [protocol.NUMBER for protocol in make_line("feetech", servos, 0.0).protocols]

    assert protocols((1, "sts3215")) == [1]
    assert protocols((1, "xl320")) == [2]
    assert protocols((1, "xl320"), (2, "sts3215")) == [1, 2]


# ---------------------------------------------------------------- served
def test_dynamixel_sdk_speaks_protocol_1_to_it():
    packets = PacketHandler(1.0)
    with SimulatedBus((1, 2), model="mx1-28", process=True) as bus:
        port = PortHandler(bus.path)
        port.setPacketTimeout = lambda length: PortHandler.setPacketTimeoutMillis(port, 3000.0)
        port.setBaudRate(1_000_000)
        assert packets.ping(port, 1) == (29, 0, 0)
        assert packets.write2ByteTxRx(port, 1, 32, 100) == (0, 0)
        assert packets.read2ByteTxRx(port, 1, 32) == (100, 0, 0)
        assert packets.write2ByteTxRx(port, 1, 30, 4096) == (0, Error1.RANGE)
        goal = GroupSyncWrite(port, packets, 30, 2)
        for device in (1, 2):
            goal.addParam(device, list(word(1000 * device)))
        assert goal.txPacket() == 0
        assert [packets.read2ByteTxRx(port, device, 30)[0] for device in (1, 2)] == [1000, 2000]
        # Its GroupBulkRead cannot be used here: in 4.1.0 it hands Protocol 1.0 an argument too many.
        port.writePort(encode(BROADCAST_ID, I.BULK_READ, b"\0\2\1\x1e\2\2\x1e"))
        port.ser.timeout = 5
        assert [packet.params for packet in Reader1().feed(port.ser.read(16))] == [word(1000), word(2000)]
        port.closePort()


def test_a_feetech_child_process_answers_bare_bytes():
    with (
        SimulatedBus((1, 2), model="sts3215", process=True) as bus,
        serial.Serial(bus.path, 1_000_000, timeout=10) as port,
    ):
        port.write(bytes.fromhex("FF FF FE 06 82 38 02 01 02 3C"))
        assert Reader1().feed(port.read(16)) == [Packet1(1, 0, word(2048)), Packet1(2, 0, word(2048))]


@pytest.mark.parametrize(("level", "answered"), [(0, False), (1, True)])
def test_group_reads_are_answered_from_level_1_on(level: int, answered: bool):
    bus = chain("mx1-28")
    bus.servo(1).registers.put("Status Return Level", level)
    assert bool(ask(bus, BROADCAST_ID, I.BULK_READ, "00 02 01 24")) is answered


def test_broken_or_addressed_group_reads_are_not_answered():
    bus = chain("mx1-28")
    assert ask(bus, BROADCAST_ID, I.BULK_READ, "00 02 01 24 02") == []
    assert ask(bus, 1, I.BULK_READ, "00 02 01 24") == []
    sts = chain("sts3215")
    assert len(ask(sts, BROADCAST_ID, I.SYNC_READ, "38 02 01 02")) == 2
    assert ask(sts, 1, I.SYNC_READ, "38 02 01") == []
    assert ask(sts, BROADCAST_ID, I.SYNC_READ, "38") == []


def test_chain_stop_ends_a_group_read_of_either_maker():
    for model, code, params in (("mx1-28", I.BULK_READ, "00 02 01 24 02 09 24 02 03 24"),
                                ("sts3215", I.SYNC_READ, "38 02 01 09 03")):  # fmt: skip
        assert [packet.id for packet in ask(chain(model), BROADCAST_ID, code, params)] == [1, 3]
        assert [packet.id for packet in ask(chain(model, faults=("chain-stop",)), BROADCAST_ID, code, params)] == [1]


def test_an_alert_is_reported_as_input_voltage():
    assert ask(chain(faults=("alert:1",)), 1, I.PING) == [Packet1(1, Error1.INPUT_VOLTAGE, b"")]
