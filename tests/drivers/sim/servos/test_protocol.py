"""drivers.sim.servos.protocol: who receives and who answers the instructions that both protocols share."""

from __future__ import annotations

import pytest

from drivers.packets import packet as two
from drivers.packets import packet1 as one
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo

LED = {"ax-12a": b"\x19", "xl330-m288": b"\x41\x00"}
"""Address of the LED register."""
WORD = {"ax-12a": 1, "xl330-m288": 2}
MODELS = list(LED)
REG_WRITE, ACTION = 4, 5
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 1, 2, 3, 0x82, 0x83


def chain(model: str, *faults: str, ids: tuple[int, ...] = (1, 2, 3)) -> Chain:
    return Chain([SimulatedServo(i, model) for i in ids], faults=faults)


def ask(bus: Chain, device: int, code: int, params: bytes = b"", now_s: float = 0.0) -> list[tuple[int, int, bytes]]:
    """(id, error, data) of each status packet that arrives."""
    legacy = bus.protocols[0].NUMBER == 1
    frame = one.encode(device, code, params) if legacy else two.encode_instruction(device, code, params)
    data = b"".join(reply.data for reply in bus.feed(frame, now_s))
    return [tuple(packet) for packet in (one.Reader1() if legacy else two.StatusReader()).feed(data)]


def leds(bus: Chain) -> list[int]:
    return [servo.register("LED", 0.0) for servo in bus.servos]


@pytest.mark.parametrize("model", MODELS)
def test_a_write_to_one_is_answered_to_all_it_is_not(model: str):
    bus = chain(model)
    assert ask(bus, 2, WRITE, LED[model] + b"\1") == [(2, 0, b"")]
    assert leds(bus) == [0, 1, 0]
    assert ask(bus, 0xFE, WRITE, LED[model] + b"\1") == []
    assert leds(bus) == [1, 1, 1]
    assert ask(bus, 4, WRITE, LED[model] + b"\0") == []
    assert leds(bus) == [1, 1, 1]


@pytest.mark.parametrize("model", MODELS)
def test_a_read_gives_as_many_bytes_as_asked_for(model: str):
    bus = chain(model)
    bus.servo(2).registers.put("LED", 1)
    assert ask(bus, 2, READ, LED[model] + (1).to_bytes(WORD[model], "little")) == [(2, 0, b"\1")]
    assert [len(data) for _, _, data in ask(bus, 2, READ, LED[model] + (3).to_bytes(WORD[model], "little"))] == [3]
    assert ask(bus, 0xFE, READ, LED[model] + (1).to_bytes(WORD[model], "little")) == []


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("level", [0, 1, 2])
def test_the_status_return_level_decides_what_is_answered_and_not_what_is_done(model: str, level: int):
    bus = chain(model, ids=(1,))
    bus.servo(1).registers.put("Status Return Level", level)
    word = WORD[model]
    assert len(ask(bus, 1, PING)) == 1
    assert len(ask(bus, 1, READ, LED[model] + (1).to_bytes(word, "little"))) == (level >= 1)
    assert len(ask(bus, 1, READ, LED[model])) == (level >= (2 if word == 1 else 1)), "malformed"
    assert len(ask(bus, 1, WRITE, LED[model] + b"\1")) == (level == 2)
    assert len(ask(bus, 1, WRITE, LED[model])) == (level == 2), "malformed"
    assert len(ask(bus, 1, 0x33)) == (level == 2), "unknown"
    assert leds(bus) == [1]


@pytest.mark.parametrize("model", MODELS)
def test_a_deaf_servo_receives_nothing_until_its_time(model: str):
    bus = chain(model)
    bus.servo(2).deaf_until = 5.0
    assert ask(bus, 2, WRITE, LED[model] + b"\1", 4.999) == []
    assert ask(bus, 0xFE, WRITE, LED[model] + b"\1", 4.999) == []
    assert leds(bus) == [1, 0, 1]
    assert [device for device, _, _ in ask(bus, 0xFE, PING, now_s=4.999)] == [1, 3]
    assert ask(bus, 2, WRITE, LED[model] + b"\1", 5.0) == [(2, 0, b"")]


@pytest.mark.parametrize("model", MODELS)
def test_a_muted_servo_with_a_twin_is_silent_with_it(model: str):
    bus = chain(model, ids=(1, 1, 2))
    ask(bus, 1, WRITE, LED[model] + b"\1")
    assert bus.protocols[0].duplicates == {1: [bus.servos[1]]}
    assert leds(bus) == [1, 1, 0], "both carry it out"
    bus.faults.add(["mute:1"], 0.0)
    assert ask(bus, 1, PING) == []
    ask(bus, 0xFE, WRITE, LED[model] + b"\0")
    assert leds(bus) == [1, 1, 0]


@pytest.mark.parametrize("model", MODELS)
def test_health_is_checked_when_a_servo_is_addressed(model: str):
    bus = chain(model, "temp:2:99")
    assert bus.servo(2).hardware_error
    bus.servo(1).plant.forced_c = 99.0
    ask(bus, 3, PING, now_s=1.0)
    assert not bus.servo(1).hardware_error
    ask(bus, 1, PING, now_s=1.0)
    assert bus.servo(1).hardware_error


@pytest.mark.parametrize("model", MODELS)
def test_sync_writes_of_whole_entries_are_carried_out(model: str):
    bus, word = chain(model), WORD[model]
    body = LED[model] + (1).to_bytes(word, "little")
    assert ask(bus, 0xFE, SYNC_WRITE, body + b"\1\1\3\1\2") == []
    assert leds(bus) == [1, 0, 1]
    ask(bus, 2, SYNC_WRITE, body + b"\2\1")
    ask(bus, 0xFE, SYNC_WRITE, body[:-1])
    assert leds(bus) == [1, 0, 1], "not to the broadcast id, or cut short"


@pytest.mark.slow
def test_errors_of_faulty_replies_are_those_of_their_protocol():
    for model in MODELS:
        (reply,) = ask(chain(model, "wrongid:2:9"), 2, PING)
        assert reply[0] == 9
        read = LED[model] + (3).to_bytes(WORD[model], "little")
        assert [len(data) for _, _, data in ask(chain(model, "short:2:2"), 2, READ, read)] == [2]
        late = chain(model, "late:2:45ms", "late:*:5ms")
        frame = one.encode(2, PING) if WORD[model] == 1 else two.encode_instruction(2, PING)
        assert [reply.late_s for reply in late.feed(frame, 0.0)] == [pytest.approx(0.05)]
        header = 4
        for _ in range(50):
            flipped = chain(model, "flip:2")
            assert flipped.feed(frame, 0.0)[0].data[:header] == chain(model).feed(frame, 0.0)[0].data[:header]


def test_an_unknown_instruction_is_refused_by_the_one_it_is_for():
    assert ask(chain("xl330-m288"), 1, 0x33) == [(1, two.ErrorNumber.INSTRUCTION, b"")]
    assert ask(chain("ax-12a"), 1, 0x33) == [(1, one.Error1.INSTRUCTION, b"")]
    assert ask(chain("xl330-m288"), 0xFE, 0x33) == []


@pytest.mark.parametrize("model", MODELS)
def test_a_registered_write_needs_data_and_waits_for_its_action(model: str):
    bus = chain(model)
    (refused,) = ask(bus, 2, REG_WRITE, LED[model])
    assert refused[1] != 0
    assert ask(bus, 2, REG_WRITE, LED[model] + b"\1") == [(2, 0, b"")]
    assert leds(bus) == [0, 0, 0]
    ask(bus, 0xFE, ACTION)
    assert leds(bus) == [0, 1, 0]
