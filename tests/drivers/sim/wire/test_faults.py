"""drivers.sim.wire.faults: the words of a fault, when it strikes, and what it does to bytes."""

from __future__ import annotations

import random

import pytest

from drivers.base.errors import DriverError
from drivers.packets.packet import StatusPacket, StatusReader, encode_status
from drivers.sim.wire.faults import KINDS, Fault, FaultSet, ReplyFault, parse_fault


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("mute:7", {"kind": "mute", "ids": {7}}),
        ("mute:*", {"ids": None}),
        ("drop:1-3,9:every=5", {"ids": {1, 2, 3, 9}, "every": 5}),
        ("late:7:45ms", {"value": 0.045}),
        ("late:7:0.5s", {"value": 0.5}),
        ("late:7", {"value": 0.045}),
        ("late:7:2", {"value": 2.0}),
        ("hw:4:0x05", {"value": 5}),
        ("volts:2:3.5:at=2s:for=500ms", {"value": 3.5, "at_s": 2.0, "for_s": 0.5}),
        ("crc:3:p=0.25:count=2", {"chance": 0.25, "count": 2}),
        ("echo", {"ids": None}),
        ("unplug:at=1s:as=/tmp/b", {"alias": "/tmp/b", "at_s": 1.0}),
        (" noise:1:9 ", {"kind": "noise", "value": 9}),
    ],
)
def test_specs(spec: str, expected: dict):
    fault = parse_fault(spec)
    for key, value in expected.items():
        assert getattr(fault, key) == (frozenset(value) if isinstance(value, set) else value)


@pytest.mark.parametrize(
    ("spec", "why"),
    [
        ("mut:7", "there is no fault 'mut'"),
        ("", "there is no fault ''"),
        ("mute", "ids are missing"),
        ("mute:x", "'x' is not an id"),
        ("mute:1-x", "'1-x' is not an id"),
        ("mute:300", "must be 0 to 252"),
        ("mute:5-3", "begins with its lower end"),
        ("mute:7:8", "'8' is one word too many"),
        ("late:7:soon", "'soon' is not a value for late"),
        ("volts:7", "volts needs a value"),
        ("stops:7", "stops needs a value"),
        ("weight:7:2", "'2' is not a value for weight"),
        ("stops:7:900..800", "'900..800' is not a value for stops"),
        ("wrongid:1:300", "'300' is not a value for wrongid"),
        ("noise:1:-1", "'-1' is not a value for noise"),
        ("short:1:-1", "'-1' is not a value for short"),
        ("volts:1:inf", "'inf' is not a value for volts"),
        ("volts:1:nan", "'nan' is not a value for volts"),
        ("hw:1:0x100", "'0x100' is not a value for hw"),
        ("baud:1:0", "'0' is not a value for baud"),
        ("late:1:-1s", "'-1s' is not a value for late"),
        ("stops:1:0..inf", "'0..inf' is not a value for stops"),
        ("unplug:for=inf", "'inf' is not a value for for"),
        ("crc:7:at=nan", "out of range"),
        ("crc:7:evry=3", "there is no option 'evry'"),
        ("crc:7:every=x", "'x' is not a value for every"),
        ("crc:7:every=0", "out of range"),
        ("crc:7:p=1.5", "out of range"),
        ("crc:7:at=-1", "out of range"),
    ],
)
def test_unreadable_specs_are_named_with_the_reason(spec: str, why: str):
    with pytest.raises(DriverError) as error:
        parse_fault(spec)
    assert repr(spec) in str(error.value)
    assert why in str(error.value)
    assert "mute" in error.value.hint


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_help_line_and_can_be_written(kind: str):
    entry = KINDS[kind]
    value = (":7..9" if kind == "stops" else ":7") if entry.value and entry.default is None else ""
    assert parse_fault(f"{kind}{'' if entry.scope == 'bus' else ':1'}{value}").kind == kind


def strikes(spec: str, ids: list[int]) -> list[bool]:
    reply_fault = ReplyFault(parse_fault(spec), random.Random(1))
    return [reply_fault.hits(device) for device in ids]


def test_every_counts_each_servo_for_itself():
    assert strikes("drop:1-2:every=2", [1, 2, 3, 1, 2, 1, 2]) == [False, False, False, True, True, False, False]


def test_count_ends_it():
    assert strikes("drop:*:count=2", [1, 2, 3, 1]) == [True, True, False, False]


def test_chance_is_about_right_and_repeatable():
    hits = strikes("drop:*:p=0.1", [1] * 5000)
    assert 400 < sum(hits) < 600
    assert hits == strikes("drop:*:p=0.1", [1] * 5000)


def corrupted(spec: str, data: bytes = b"\1\2\3\4") -> bytes | None:
    """A status packet of servo 5 as a servo on a wire with this fault sends it."""
    faults = FaultSet(lambda *change: None, seed=1)
    faults.add([spec], 0.0)
    return faults.corrupt(
        encode_status(5, 0x80, data),
        5,
        first=4,
        shorten=lambda frame, size: encode_status(5, 0x80, data[:size]),
        readdress=lambda frame, other: encode_status(other, 0x80, data),
    )[0]


def test_what_happens_to_a_status_packet():
    frame = encode_status(5, 0x80, b"\1\2\3\4")
    assert corrupted("drop:*") is None
    assert corrupted("silent:*") is None
    assert StatusReader().feed(corrupted("short:*:2")) == [StatusPacket(5, 0x80, b"\1\2")]
    assert StatusReader().feed(corrupted("wrongid:*:9")) == [StatusPacket(9, 0x80, b"\1\2\3\4")]
    assert corrupted("crc:*")[:-1] == frame[:-1]
    assert corrupted("crc:*")[-1] != frame[-1]
    assert corrupted("noise:*:6")[6:] == frame
    assert len(corrupted("noise:*:6")) == len(frame) + 6
    assert corrupted("late:*") == frame


def test_flip_changes_exactly_one_bit_behind_the_header():
    frame = encode_status(5, 0x80, b"\1\2\3\4")
    places = set()
    faults = FaultSet(lambda *change: None)
    faults.add(["flip:*"], 0.0)
    for _ in range(300):
        changed = faults.corrupt(frame, 5, first=4)[0]
        difference = int.from_bytes(changed, "big") ^ int.from_bytes(frame, "big")
        assert difference.bit_count() == 1
        assert changed[:4] == frame[:4]
        places.add(difference)
    assert len(places) > 60


def test_without_a_frame_format_data_is_cut_and_late_replies_add_up():
    faults = FaultSet(lambda *change: None)
    faults.add(["short:1:2", "late:*:0.5", "late:1:0.25", "silent:2"], 0.0)
    assert faults.corrupt(b"abcd", 1) == (b"ab", 0.75)
    assert faults.corrupt(b"abcd", 2) == (None, 0.5)
    assert faults.corrupt(b"abcd", 3) == (b"abcd", 0.5)


def recorded(*specs: str | Fault, now_s: float = 0.0) -> tuple[FaultSet, list[tuple[str, bool, float]]]:
    seen: list[tuple[str, bool, float]] = []
    faults = FaultSet(lambda fault, begins, at: seen.append((fault.kind, begins, at)))
    faults.add(specs, now_s)
    return faults, seen


def test_faults_begin_and_end_at_their_times_even_when_looked_at_late():
    faults, seen = recorded("stall:1:at=1s:for=2s", "mute:2", now_s=10.0)
    assert seen == [("mute", True, 10.0)]
    assert faults.next_change_s == 11.0
    faults.advance(99.0)
    assert seen[1:] == [("stall", True, 11.0), ("stall", False, 13.0)]
    assert faults.next_change_s == float("inf")
    assert [fault.kind for fault in faults.active] == ["mute"]


def test_clearing_ends_what_runs_and_forgets_what_was_to_come():
    faults, seen = recorded("crc:1", "crc:2:at=5s", "mute:2")
    faults.clear("crc", 1.0)
    assert seen[-1] == ("crc", False, 1.0)
    assert faults.reply_faults == []
    assert faults.next_change_s == float("inf")
    faults.clear(None, 2.0)
    assert faults.active == []


def test_a_fault_that_was_cleared_does_not_end_twice():
    faults, seen = recorded("mute:1:for=2s")
    faults.clear("other", 0.5)
    assert faults.next_change_s == 2.0
    faults.clear("mute", 1.0)
    faults.advance(5.0)
    assert seen == [("mute", True, 0.0), ("mute", False, 1.0)]


def test_one_bad_spec_sets_none():
    seen: list[object] = []
    faults = FaultSet(lambda *change: seen.append(change))
    with pytest.raises(DriverError):
        faults.add(["mute:1", "mute:x"], 0.0)
    assert (seen, faults.active) == ([], [])


def test_a_bus_may_have_few_kinds_of_fault():
    faults = FaultSet(lambda *change: None, kinds=("echo", "unplug"))
    faults.add(["echo"], 0.0)
    with pytest.raises(DriverError, match=r"'mute:1': a bus of this kind has only echo, unplug"):
        faults.add(["unplug", "mute:1"], 0.0)
    assert [fault.kind for fault in faults.active] == ["echo"]


def test_ids_are_inclusive_and_end_at_252():
    assert parse_fault("mute:0,3-5,252").ids == {0, 3, 4, 5, 252}
    for spec in ("mute:253", "mute:250-253", "mute:"):
        with pytest.raises(DriverError):
            parse_fault(spec)


@pytest.mark.parametrize("spec", ["crc:7:p=0", "crc:7:p=1", "crc:7:every=1", "crc:7:at=0", "noise:1:0"])
def test_values_at_their_ends_are_allowed(spec: str):
    assert parse_fault(spec).spec == spec


def test_a_wrong_option_among_good_ones_is_named():
    with pytest.raises(DriverError, match=r"'p=2' is out of range"):
        parse_fault("crc:7:every=2:p=2:count=1")


@pytest.mark.parametrize(
    ("kind", "scope", "default"),
    [("late", "reply", 0.045), ("short", "reply", 1), ("noise", "reply", 5), ("hw", "servo", 0x20),
     ("eeprom-busy", "servo", 0.02), ("slow-reader", "bus", 0.2)],
)  # fmt: skip
def test_defaults_of_the_documentation(kind: str, scope: str, default: float):
    assert (KINDS[kind].scope, parse_fault(kind if scope == "bus" else f"{kind}:1").value) == (scope, default)


def test_a_chance_is_taken_only_where_it_is_below_one():
    rng = random.Random(1)
    before = rng.getstate()
    assert all(ReplyFault(parse_fault("drop:*"), rng).hits(1) for _ in range(9))
    assert rng.getstate() == before
    assert not any(ReplyFault(parse_fault("drop:*:p=0"), rng).hits(1) for _ in range(99))


def test_a_hit_that_chance_spares_is_not_counted():
    fault = ReplyFault(parse_fault("drop:*:p=0.5:count=3"), random.Random(3))
    assert sum(fault.hits(1) for _ in range(99)) == 3


def test_faults_due_at_one_moment_change_in_the_order_they_were_set():
    faults, seen = recorded("mute:1:at=1s", "echo:at=1s", "stall:1:at=0.5s")
    faults.advance(1.0)
    assert [kind for kind, _, _ in seen] == ["stall", "mute", "echo"]


def test_equal_faults_end_one_by_one():
    faults, seen = recorded("crc:1:for=1s", "crc:1")
    assert len(faults.reply_faults) == 2
    faults.advance(1.0)
    assert (len(faults.reply_faults), len(faults.active)) == (1, 1)
    assert seen[-1] == ("crc", False, 1.0)


def test_the_same_seed_gives_the_same_noise():
    def noise(seed: int) -> bytes | None:
        faults = FaultSet(lambda *change: None, seed)
        faults.add(["noise:*:8"], 0.0)
        return faults.corrupt(b"", 1)[0]

    assert noise(4) == noise(4) != noise(5)
