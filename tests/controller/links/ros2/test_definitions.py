"""controller.links.ros2.definitions: types on the wire, against bytes written by hand (OMG DDS-XTypes, CDR)."""

from __future__ import annotations

import struct

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="pip install 'omote[ros2]'")

from controller.links.ros2.definitions import UNITS, MessageTypes, message_types
from controller.links.ros2.wire import NO_HASH
from surface.base.errors import MissingPackage

EXPRESSION, ACTION_UNITS = "hri_msgs/msg/Expression", "hri_msgs/msg/FacialActionUnits"


def header(types: MessageTypes, seconds: int, nanoseconds: int, frame: str) -> object:
    stamp = types.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return types.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def text(data: bytes, word: str) -> bytes:
    """Bytes with a CDR string behind them, aligned to four bytes from the end of the encapsulation header."""
    data += b"\0" * (-(len(data) - 4) % 4)
    return data + struct.pack("<I", len(word) + 1) + word.encode() + b"\0"


@pytest.mark.parametrize("distribution", ["humble", "jazzy"])
def test_an_expression_is_a_header_its_name_and_three_numbers(distribution: str) -> None:
    types = message_types(distribution)
    message = types.make(EXPRESSION, header=header(types, 7, 9, "base"), expression="happy", valence=0.5,
                         arousal=-0.25, confidence=1.0)  # fmt: skip
    wanted = text(text(b"\0\1\0\0" + struct.pack("<iI", 7, 9), "base"), "happy")
    wanted += b"\0" * (-(len(wanted) - 4) % 4) + struct.pack("<3f", 0.5, -0.25, 1.0)
    data = types.encode(message, EXPRESSION)
    assert data == wanted
    again = types.decode(data, EXPRESSION)
    assert (again.expression, again.valence, again.header.stamp.sec, again.header.frame_id) == ("happy", 0.5, 7, "base")


def test_action_units_are_arrays_with_an_entry_for_every_number_of_facs() -> None:
    types, levels = message_types("humble"), np.arange(UNITS, dtype=np.float32) / 128
    message = types.make(ACTION_UNITS, header=header(types, 1, 2, ""), intensity=levels, confidence=levels + 1)
    data = types.encode(message, ACTION_UNITS)
    assert UNITS == 99 and len(data) >= 4 + 8 + 4 + 2 * 4 * UNITS
    again = types.decode(data, ACTION_UNITS)
    np.testing.assert_array_equal(again.intensity, levels)
    np.testing.assert_array_equal(again.confidence, levels + 1)


def test_types_have_hashes_from_iron_on() -> None:
    """REP 2016: RIHS01 hashes are part of a topic's key; Humble has none."""
    old, new = (message_types(name).topic("/face", EXPRESSION) for name in ("humble", "jazzy"))
    assert (old.name, old.message_type, old.type_hash) == ("/face", EXPRESSION, NO_HASH)
    assert new.type_hash.startswith("RIHS01_") and len(new.type_hash) == len("RIHS01_") + 64
    other = message_types("jazzy").topic("/face", ACTION_UNITS)
    assert other.type_hash != new.type_hash
    known = message_types("jazzy").topic("/x", "std_msgs/msg/String").type_hash
    assert known == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"  # rosidl's own


def test_types_are_read_once_and_damaged_bytes_are_an_error() -> None:
    types = message_types("humble")
    assert message_types("humble") is types and message_types("jazzy") is not types
    with pytest.raises(Exception):  # noqa: B017  whatever rosbags raises
        types.decode(b"\0\1\0\0\7", EXPRESSION)


def test_without_rosbags_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(MissingPackage, match="rosbags"):
        MessageTypes("humble")
