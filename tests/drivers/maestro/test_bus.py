"""drivers.maestro.bus: the bytes that go to a Maestro, against examples and units of Pololu's User's Guide."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError, NoReply, ServoRefused
from drivers.sim.serving.virtual import VirtualBus

US_PER_RAD = 2000 / math.pi
"""Slope of an rc-180: 2000 us for half a turn."""
SERVO = ServoSpec(5, "jaw", "rc-180", -0.7, 0.7, 3499 / US_PER_RAD, 1249 / US_PER_RAD)
QUICK = {"stagger_s": 0.0, "margin_s": 0.02}


def board(*servos: ServoSpec, **options: object) -> VirtualBus:
    return VirtualBus(servos or (SERVO,), "maestro", driver=QUICK | options, baud=115_200)


def sent_by(rig: VirtualBus) -> bytearray:
    """What goes to the board from now on."""
    data = bytearray()
    rig.link.tap = lambda out, piece: data.extend(piece) if out else None
    return data


def limits_of(servo: ServoSpec) -> tuple[int, int]:
    """Speed and acceleration that a board has after the start."""
    rig = board(servo)
    with rig.bus() as bus:
        bus.start()
        return rig.line.speeds[servo.id], rig.line.accelerations[servo.id]


def test_limits_of_motion_are_those_of_the_guides_examples() -> None:
    """The guide: 87 05 0C 01 is speed 140, 3.5 us/ms; 89 05 04 00 is acceleration 4, in 0.25 us per 10 ms per 80 ms."""
    rig = board()
    data = sent_by(rig)
    with rig.bus() as bus:
        bus.start()
        assert bytes.fromhex("87 05 0C 01  89 05 04 00") in bytes(data)
        assert bus._stop_us.tolist() == [pytest.approx(3500**2 / (2 * 4 * 0.25 / 0.010 / 0.080))]


@pytest.mark.parametrize(
    ("us_s", "us_s2", "speed", "acceleration"),
    [
        (24.9, 312.4, 1, 1),
        (25.1, 312.6, 2, 2),
        (409_574, 255 * 312.5 - 1, 0x3FFF, 255),
        (500_000, 255 * 312.5 + 1, 0x3FFF, 0),  # faster than a board can be told: no limit
    ],
)
def test_limits_are_rounded_up_and_end_where_the_board_does(
    us_s: float, us_s2: float, speed: int, acceleration: int
) -> None:
    servo = replace(SERVO, max_speed_rad_s=us_s / US_PER_RAD, max_accel_rad_s2=us_s2 / US_PER_RAD)
    assert limits_of(servo) == (speed, acceleration)


def test_a_board_without_a_limit_of_acceleration_needs_no_way_to_stop() -> None:
    rig = board(replace(SERVO, max_accel_rad_s2=1e6))
    with rig.bus() as bus:
        bus.start()
        assert bus._stop_us.tolist() == [0.0]


def test_a_target_is_in_quarter_microseconds() -> None:
    rig = board(replace(SERVO, id=2, max_speed_rad_s=500.0))
    with rig.bus() as bus:
        bus.start()
        rig.clock.sleep(0.05)
        data = sent_by(rig)
        assert bus.write([0.0]).tolist() == [0.0]
        assert bytes(data) == bytes.fromhex("84 02 70 2E")  # the guide's example: 1500 us on channel 2
        rig.clock.sleep(0.05)
        data.clear()
        sent = bus.write([0.0501 / US_PER_RAD * 5])  # 0.2505 us: one quarter
        assert bytes(data) == bytes.fromhex("84 02 71 2E")
        assert sent == pytest.approx([0.25 / US_PER_RAD])


def test_a_target_that_is_no_number_is_kept() -> None:
    servos = [replace(SERVO, id=i, name=f"s{i}", max_speed_rad_s=500.0) for i in (3, 0, 1)]
    rig = board(*servos)
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        bus.write([math.nan, 0.0, 0.0])
        assert bytes(data) == bytes.fromhex("9F 02 00 70 2E 70 2E  84 03 70 2E")


def test_a_micro_maestro_gets_a_command_for_each_channel() -> None:
    servos = [replace(SERVO, id=i, name=f"s{i}") for i in (1, 0)]
    rig = board(*servos, board="micro")
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        bus.write([0.0, 0.0])
        assert bytes(data) == bytes.fromhex("84 01 70 2E  84 00 70 2E")


def test_opening_sends_the_byte_by_which_a_board_finds_the_rate() -> None:
    rig = board()
    data = sent_by(rig)
    with rig.bus():
        assert bytes(data) == b"\xaa"


def test_stopping_ends_the_pulses() -> None:
    rig = board()
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        bus.stop()
        assert bytes(data).startswith(bytes.fromhex("84 05 00 00"))
        assert rig.line.describe(rig.clock())[5]["pulse_us"] == 0


def test_the_far_end_is_set_as_the_driver_is() -> None:
    assert open_bus("maestro", [SERVO], port="").far_end() == {
        "board": "mini", "device": 12, "crc": False,
        "limits_us": [pytest.approx(1500 - 0.7 * US_PER_RAD), pytest.approx(1500 + 0.7 * US_PER_RAD)],
    }  # fmt: skip
    other = open_bus("maestro", [SERVO], port="", board="micro", device=0, crc=True).far_end()
    assert (other["board"], other["device"], other["crc"]) == ("micro", 0, True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"board": "maxi"}, "no Maestro 'maxi'"),
        ({"device": 128}, "device must be 0 to 127, got 128"),
        ({"device": -1}, "got -1"),
    ],
)
def test_options_that_do_not_fit_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(DriverError, match=message) as caught:
        open_bus("maestro", [SERVO], port="", **options)
    assert caught.value.hint
    assert open_bus("maestro", [SERVO], port="", device=127)


def test_a_silent_board_is_named_with_its_channels() -> None:
    rig = board(SERVO, replace(SERVO, id=7, name="brow"))
    rig.fault("mute:*")
    with rig.bus() as bus, pytest.raises(NoReply, match=r"on virtual does not report .* channels 5, 7$") as caught:
        bus.start()
    assert caught.value.servo_ids == (5, 7)
    assert "serial mode" in caught.value.hint


def test_errors_of_the_board_are_counted_by_name_and_from_before_the_start_ignored(
    caplog: pytest.LogCaptureFixture,
) -> None:
    rig = board()
    with rig.bus() as bus, caplog.at_level(logging.WARNING):
        rig.line.feed(bytes((0x84, 99, 0, 0)), rig.clock())  # a channel that is not there
        bus.start()
        bus.read()
        assert bus.report().errors == {}
        rig.line.feed(bytes((0x84, 99, 0, 0)), rig.clock())
        bus.read()
        bus.read()
        assert bus.report().errors == {"board_protocol": 1, "torque_lost": 1}
        assert "reports: protocol; it stopped all pulses" in caplog.text


def test_a_board_that_refuses_at_the_start_is_switched_off_again() -> None:
    servos = (SERVO, replace(SERVO, id=4, name="brow"))
    rig = VirtualBus(servos, "maestro", driver=QUICK, baud=115_200, options={"board": "micro"})
    with rig.bus() as bus:
        with pytest.raises(ServoRefused, match="reports protocol") as caught:
            bus.start()
        assert caught.value.servo_ids == (5, 4)
        assert not bus.running
    assert [row["pulse_us"] for row in rig.line.describe(rig.clock())] == [0] * 6


def test_after_a_reset_the_board_gets_its_limits_again() -> None:
    rig = board()
    with rig.bus() as bus:
        bus.start()
        limits = rig.line.speeds[5], rig.line.accelerations[5]
        rig.line.reset(rig.clock())
        assert (rig.line.speeds[5], rig.line.accelerations[5]) == (0, 0)
        bus.read()
        assert not bus.read().torque.any()
        assert bus.report().errors["torque_lost"] == 1
        bus.write([0.0])
        assert (rig.line.speeds[5], rig.line.accelerations[5]) == limits
        assert bus.read().torque.all()
        np.testing.assert_allclose(bus.read().position_rad, 0.0, atol=1e-9)


def test_several_channels_are_asked_in_one_go_with_the_boards_errors() -> None:
    servos = [replace(SERVO, id=i, name=f"s{i}", rest_rad=0.1 * i) for i in range(3)]
    rig = board(*servos)
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        state = bus.read()
        assert bytes(data) == bytes.fromhex("90 00  90 01  90 02  A1  AE")
        np.testing.assert_allclose(state.position_rad, [0.0, 0.1, 0.2], atol=1e-3)
        assert bus.report().errors == {}


def test_more_than_eight_channels_are_asked_in_turn() -> None:
    servos = [replace(SERVO, id=i, name=f"s{i}") for i in range(10)]
    rig = board(*servos)
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        asked = []
        for _ in range(4):
            data.clear()
            bus.read()
            asked.append([data[at + 1] for at in range(0, len(data) - 2, 2)])
        assert sorted(asked[0] + asked[1]) == [*range(10)]
        assert {len(asked[0]), len(asked[1])} == {8, 2}
        assert asked[2:] == asked[:2]


def test_silence_is_counted_and_a_start_after_it_does_not_wait() -> None:
    rig = board()
    with rig.bus() as bus:
        bus.start()
        rig.fault("mute:*")
        assert bus.read().silent.all()
        assert bus.report().errors == {"no_reply": 1}
        with pytest.raises(NoReply):
            bus.discover()
        rig.clear()
        assert [info.torque for info in bus.discover()] == [True]


def test_a_board_that_holds_a_servo_back_is_named(caplog: pytest.LogCaptureFixture) -> None:
    servos = (replace(SERVO, rest_rad=-0.7), replace(SERVO, id=6, name="brow", rest_rad=0.003))
    rig = VirtualBus(servos, "maestro", driver=QUICK, baud=115_200, options={"limits_us": (1200, 1800)})
    with rig.bus() as bus, caplog.at_level(logging.WARNING):
        bus.start()
        np.testing.assert_allclose(bus.read().position_rad, [-300 / US_PER_RAD, 0.003], atol=1e-3)
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("channel 5 (jaw) on virtual stays at 1200 us")


def test_a_channel_that_goes_on_with_its_pulses_is_not_off() -> None:
    rig = board(SERVO, replace(SERVO, id=6, name="brow"))
    with rig.bus() as bus:
        bus.start()
        go = rig.line.channels[6].go
        rig.line.channels[6].go = lambda *given: None  # it takes no target any more
        with pytest.raises(NoReply, match=r"not confirmed off on virtual: 6 \(brow\)") as caught:
            bus.stop()
        assert caught.value.servo_ids == (6,)
        assert not bus.running
        assert [row["pulse_us"] for row in rig.line.describe(rig.clock())[5:7]] == [0, 1500]
        rig.line.channels[6].go = go
    assert [row["pulse_us"] for row in rig.line.describe(rig.clock())[5:7]] == [0, 0]


def test_a_board_whose_answers_are_lost_in_the_start_is_switched_off_as_soon_as_it_answers() -> None:
    rig = VirtualBus([SERVO], "maestro", driver=QUICK | {"stagger_s": 0.3}, baud=115_200)
    rig.fault("silent:*:at=0.2s")
    with pytest.raises(NoReply, match=r"not confirmed off on virtual: 5 \(jaw\)"), rig.bus() as bus:
        bus.start()
    assert rig.line.describe(rig.clock())[5]["pulse_us"] == 0, "it hears, and was told"
    rig.clear()
    bus.open()
    assert bus.may_be_on
    bus.stop()
    assert not bus.may_be_on
    bus.close()


@pytest.mark.parametrize("number", [0, 1])
def test_a_start_needs_to_know_whether_the_board_has_errors(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The board forgets its errors as it reports them; an answer that is lost may have had one."""
    rig = VirtualBus([SERVO, replace(SERVO, id=4, name="brow")], "maestro", driver=QUICK, baud=115_200,
                     options={"board": "micro"})  # fmt: skip
    with rig.bus() as bus:
        checked, request = bus._send_and_check, bus._request

        def check(start: object) -> object:
            seen = iter(range(9))

            def lose(*given: object) -> object:
                answer = request(*given)
                return None if next(seen) == number else answer

            monkeypatch.setattr(bus, "_request", lose)
            try:
                return checked(start)
            finally:
                monkeypatch.setattr(bus, "_request", request)

        monkeypatch.setattr(bus, "_send_and_check", check)
        with pytest.raises((NoReply, ServoRefused), match=r"whether it has errors|reports protocol"):
            bus.start()
    assert [row["pulse_us"] for row in rig.line.describe(rig.clock())] == [0] * 6


def test_after_a_pulse_that_cannot_be_the_board_is_asked_for_its_state_alone_first() -> None:
    rig = board(replace(SERVO, max_accel_rad_s2=1e6))
    with rig.bus() as bus:
        bus.start()
        rig.line.channels[5].go(4 * 1900.0, rig.clock())  # not what it was told
        state = bus.read()
        np.testing.assert_allclose(state.position_rad, 0.0, atol=1e-9)
        assert bus.report().errors_by_servo == {5: {"corrupt": 1}}
        data = sent_by(rig)
        bus.read()
        assert bytes(data) == bytes.fromhex("AE  90 05 A1 AE")
