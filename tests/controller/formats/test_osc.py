"""OSC messages and bundles against python-osc, the specification's examples, and damaged ones."""

from __future__ import annotations

import math
import struct

import pytest

from controller.formats.frame import Refusals
from controller.formats.osc import MAX_BUNDLE_DEPTH, bundle, message, read_packet

SPECIFICATION = [
    (
        bytes.fromhex("2f6f7363696c6c61746f722f342f6672657175656e6379002c66000043dc0000"),
        ("/oscillator/4/frequency", [440.0]),
    ),
    (
        bytes.fromhex("2f666f6f000000002c69697366660000000003e8ffffffff68656c6c6f0000003f9df3b640b5b22d"),
        ("/foo", [1000, -1, "hello", pytest.approx(1.234), pytest.approx(5.678)]),
    ),
]
"""The examples of the OSC 1.0 specification, "OSC Message Examples"."""


@pytest.mark.parametrize(("data", "meaning"), SPECIFICATION)
def test_the_examples_of_the_specification_are_read(data: bytes, meaning: tuple[str, list[object]]) -> None:
    refused = Refusals()
    assert read_packet(data, refused) == [meaning] and not refused


def test_the_first_example_of_the_specification_is_written() -> None:
    assert message("/oscillator/4/frequency", 440.0) == SPECIFICATION[0][0]


def test_another_library_reads_what_is_written() -> None:
    osc_bundle = pytest.importorskip("pythonosc.osc_bundle")
    given = ["text", 7, -0.25, True, False, b"\1\2\3", None]
    data = bundle([message("/a", *given), bundle([message("/b/ü", "", 1.5)])])
    outer = osc_bundle.OscBundle(data)
    assert outer.num_contents == 2
    assert (outer.content(0).address, outer.content(0).params) == ("/a", given)
    inner = outer.content(1).content(0)
    assert (inner.address, inner.params) == ("/b/ü", ["", 1.5])


def test_what_another_library_writes_is_read() -> None:
    builder = pytest.importorskip("pythonosc.osc_message_builder")
    bundles = pytest.importorskip("pythonosc.osc_bundle_builder")
    given = [
        ("s", "abc"),
        ("i", -3),
        ("f", 0.5),
        ("d", math.pi),
        ("h", 1 << 40),
        ("T", True),
        ("b", b"12345"),
        ("s", ""),
    ]
    made = builder.OscMessageBuilder("/x")
    for tag, value in given:
        made.add_arg(value, tag)
    whole = bundles.OscBundleBuilder(bundles.IMMEDIATELY)
    whole.add_content(made.build())
    refused = Refusals()
    assert read_packet(whole.build().dgram, refused) == [("/x", [value for _, value in given])] and not refused


def test_a_message_may_lack_its_type_tags_as_those_of_old_senders_do() -> None:
    assert read_packet(b"/VMC/Ext/Blend/Apply\0\0\0\0", Refusals()) == [("/VMC/Ext/Blend/Apply", [])]


@pytest.mark.parametrize(
    "data",
    [b"", b"\0\0\0\0", b"x", b"/a", b"/a\0\0,f\0\0", b"/a\0\0,f\0\0\0\0", b"/a\0\0,s\0\0abc", b"/a\0\0,?\0\0",
     b"/a\0\0,b\0\0\xff\xff\xff\xff", b"/a\0\0,b\0\0\0\0\0\x09ab\0\0", b"a\0\0\0,\0\0\0"],
)  # fmt: skip
def test_a_damaged_message_is_counted_and_nothing_else(data: bytes) -> None:
    refused = Refusals()
    assert read_packet(data, refused) == [] and sum(refused.values()) == 1


def test_what_stands_before_damage_in_a_bundle_is_kept() -> None:
    refused = Refusals()
    good, other = message("/a", 1.0), message("/b", 2.0)
    torn = bundle([good, other])[:-8]
    assert read_packet(torn, refused) == [("/a", [1.0])] and sum(refused.values()) == 1
    spoilt = bundle([good, b"no message!!", other])
    assert [address for address, _ in read_packet(spoilt, refused)] == ["/a", "/b"]
    negative = b"#bundle\0" + bytes(8) + struct.pack(">i", -4)
    assert read_packet(negative, refused) == []


def test_bundles_inside_bundles_have_an_end() -> None:
    data, refused = message("/a"), Refusals()
    for _ in range(MAX_BUNDLE_DEPTH + 1):
        data = bundle([data])
    assert read_packet(data, refused) == [] and sum(refused.values()) == 1
