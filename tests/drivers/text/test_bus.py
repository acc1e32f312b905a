"""drivers.text.bus: the lines that go to a text board, and what its answers say."""

from __future__ import annotations

import logging
import math

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import DriverError
from drivers.sim.serving.virtual import VirtualBus

SERVOS = tuple(ServoSpec(i, f"s{i}", "rc-180", -0.7, 0.7, 500.0, 5000.0, rest_rad=0.1) for i in (1, 2, 7))
QUERY = {"query": "?{ch}\n", "answer": "{ch}={us}\n"}
DEGREE = math.radians(1)


def board(servos: tuple[ServoSpec, ...] = SERVOS, **texts: str) -> VirtualBus:
    texts = {"template": "S{ch},{us}\n", "off": "D{ch}\n"} | texts
    return VirtualBus(servos, "text", driver={"stagger_s": 0.0, "margin_s": 0.02} | texts, baud=115_200)


def sent_by(rig: VirtualBus) -> bytearray:
    data = bytearray()
    rig.link.tap = lambda out, piece: data.extend(piece) if out else None
    return data


def quiet(bus: Bus, rig: VirtualBus, target: list[float]) -> None:
    """Send a target until it is reached and nothing changes any more."""
    for _ in range(10):
        bus.write(target)
        rig.clock.sleep(0.02)


def test_what_is_only_read_needs_no_step_inside_the_limits() -> None:
    narrow = (ServoSpec(1, "s1", "rc-180", math.radians(10.2), math.radians(10.8), 500.0, 5000.0),)
    texts = {"template": "S{ch},{deg:.2f}\n", "query": "?{ch}\n", "answer": "{ch}={deg}\n"}
    assert open_bus("text", narrow, port="", **texts)
    with pytest.raises(DriverError, match="no value on the wire lies inside its limits"):
        open_bus("text", narrow, port="", **texts | {"template": "S{ch},{deg:d}\n"})


@pytest.mark.parametrize(
    ("template", "line"),
    [
        ("{ch}:{us}\n", b"1:1600\n2:1600\n7:1600\n"),
        ("{ch}:{deg}\n", b"1:9.0\n2:9.0\n7:9.0\n"),
        ("{ch}:{deg:.3f}\n", b"1:9.000\n2:9.000\n7:9.000\n"),
        ("{ch}:{deg:f}\n", b"1:9.000000\n2:9.000000\n7:9.000000\n"),
        ("{ch}:{deg10:05d}\n", b"1:00090\n2:00090\n7:00090\n"),
        ("{name}={angle}\n", b"s1=99\ns2=99\ns7=99\n"),
    ],
)
def test_every_value_of_a_position(template: str, line: bytes) -> None:
    rig = board(template=template)
    with rig.bus() as bus:
        bus.start()
        quiet(bus, rig, [0.0, 0.0, 0.0])
        data = sent_by(rig)
        sent = bus.write([9.0 * DEGREE] * 3)
        assert bytes(data) == line
        np.testing.assert_allclose(sent, 9.0 * DEGREE, atol=1e-9)


def test_what_was_sent_is_the_value_with_the_decimals_of_its_format() -> None:
    for spec, step in ((".0f", 1.0), (".1f", 0.1), (".2f", 0.01), ("f", 1e-6), ("d", 1.0)):
        rig = board(template="{ch}:{deg:" + spec + "}\n")
        with rig.bus() as bus:
            bus.start()
            quiet(bus, rig, [0.0, 0.0, 0.0])
            sent = math.degrees(bus.write([7.654321 * DEGREE] * 3)[0])
            assert sent == pytest.approx(round(7.654321 / step) * step, abs=1e-9)


def test_a_line_says_how_long_the_board_has_for_it() -> None:
    rig = board(template="#{ch}P{us}", begin="<{time_ms}:", separator=",", end=">\n")
    with rig.bus() as bus:
        bus.start()
        quiet(bus, rig, [0.0, 0.0, 0.0])
        data = sent_by(rig)
        for pause_s, told in ((0.0301, b"<30:"), (0.0, b"<1:"), (7.0, b"<1000:")):
            rig.clock.sleep(pause_s - 0.02 if pause_s == 0.0301 else pause_s)
            data.clear()
            bus.write([0.1 if told != b"<1:" else 0.2] * 3)
            assert bytes(data).startswith(told) and bytes(data).endswith(b">\n")
            assert data.count(b",") == 2


def test_changes_and_one_more_in_turn_are_sent() -> None:
    rig = board()
    with rig.bus() as bus:
        bus.start()
        quiet(bus, rig, [0.0, 0.0, 0.0])
        seen = []
        data = sent_by(rig)
        for _ in range(6):
            data.clear()
            bus.write([0.0, 0.0, 0.0])
            seen.append(bytes(data))
        assert sorted(set(seen)) == [b"S1,1500\n", b"S2,1500\n", b"S7,1500\n"]
        assert seen[:3] == seen[3:]
        for _ in range(3):
            data.clear()
            bus.write([math.nan, math.nan, math.nan])  # the last targets are sent in turn still
            assert data.count(b"\n") == 1


def test_without_a_question_the_position_is_what_was_sent() -> None:
    rig = board()
    with rig.bus() as bus:
        assert np.isnan(bus.read().position_rad).all()
        bus.start()
        np.testing.assert_allclose(bus.read().position_rad, 0.1, atol=1e-3)
        sent = bus.write([0.2, -0.2, 0.0])
        state = bus.read()
        np.testing.assert_allclose(state.position_rad, sent)
        assert np.isinf(state.age_s).sum() == 0
        assert not state.fresh.any()


def test_each_servo_is_switched_off_by_itself() -> None:
    rig = board()
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        bus.stop()
        assert bytes(data) == b"D1\nD2\nD7\n" * 2
    assert rig.line.values == {1: None, 2: None, 7: None}


@pytest.mark.parametrize(
    ("template", "answer"),
    [
        ("S{ch},{us}\n", "{ch}={us}\n"),
        ("S{ch},{deg:.2f}\n", "{name} at {deg}\n"),
        ("S{ch},{unit:.4f}\n", "{id}:{unit}\n"),
    ],
)
def test_answers_say_where_each_servo_is(template: str, answer: str) -> None:
    rig = board(template=template, query="?{ch}\n", answer=answer)
    with rig.bus() as bus:
        bus.start()
        targets = [0.3, -0.2, 0.1]
        sent = bus.write(targets)
        for _ in range(3):
            state = bus.read()
        np.testing.assert_allclose(state.position_rad, sent, atol=0.02)
        assert not state.silent.any()
        assert bus.report().errors == {}


def test_answers_of_others_are_stray_and_impossible_ones_corrupt() -> None:
    rig = board(**QUERY)
    with rig.bus() as bus:
        bus.start()
        quiet(bus, rig, [0.0, 0.0, 0.0])
        bus.read()
        answer = rig.line.answer
        rig.line.answer = lambda packet, now_s: [(9, b"9=1500\nhello\n"), *answer(packet, now_s)]  # type: ignore[method-assign]
        bus.read()
        assert bus.report().stray > 0
        assert bus.report().errors == {}
        rig.line.answer = lambda packet, now_s: [(2, b"2=1900\n")] if packet.kind == "query" else []  # type: ignore[method-assign]
        before = bus.read().position_rad
        assert bus.report().errors_by_servo[2]["corrupt"] >= 1
        np.testing.assert_allclose(before, 0.0, atol=1e-9)


def test_a_servo_without_answers_is_silent_after_two_and_asked_once_a_second(caplog: pytest.LogCaptureFixture) -> None:
    rig = board(**QUERY)
    with rig.bus() as bus, caplog.at_level(logging.WARNING):
        bus.start()
        bus.read()
        rig.fault("silent:2")
        before = rig.clock()
        assert bus.read().silent.tolist() == [False] * 3
        assert 0.02 < rig.clock() - before < 0.05
        assert bus.read().silent.tolist() == [False, True, False]
        assert bus.report().errors_by_servo == {2: {"no_reply": 2}}
        assert bus.report().silent == (2,)
        assert "does not answer about 2" in caplog.text
        data = sent_by(rig)
        bus.read()
        assert b"?2" not in data and b"?1" in data
        rig.clock.sleep(1.1)
        bus.read()  # asks it again, by itself
        assert bytes(data).endswith(b"?2\n")
        assert bus.report().errors_by_servo == {2: {"no_reply": 3}}
        rig.clear()
        rig.clock.sleep(1.1)
        assert bus.read().silent.tolist() == [False] * 3


def test_a_template_for_several_servos_names_them() -> None:
    with pytest.raises(DriverError, match="does not say which servo") as caught:
        open_bus("text", SERVOS, port="", template="{us}\n")
    assert "{ch}" in caught.value.hint
    assert open_bus("text", SERVOS[:1], port="", template="{us}\n")


def test_the_far_end_gets_the_same_texts_and_names() -> None:
    far_end = open_bus("text", SERVOS, port="", template="{ch}{us}\n", off="x").far_end()
    assert far_end["names"] == ["s1", "s2", "s7"]
    assert far_end["texts"] == {"template": "{ch}{us}\n", "off": "x"} | dict.fromkeys(
        ("begin", "separator", "end", "query", "answer"), ""
    )


def test_a_board_that_cannot_be_switched_off_is_warned_about_once_a_start(caplog: pytest.LogCaptureFixture) -> None:
    rig = board(off="")
    with caplog.at_level(logging.WARNING), rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        bus.stop()
        assert bytes(data) == b""
    assert caplog.text.count("cannot be switched off") == 1


def test_the_turn_begins_with_the_first_servo() -> None:
    rig = board()
    with rig.bus() as bus:
        bus.start()
        data = sent_by(rig)
        for _ in range(4):
            bus.write([0.1, 0.1, 0.1])
        assert [line[:2] for line in bytes(data).splitlines()] == [b"S1", b"S2", b"S7", b"S1"]
