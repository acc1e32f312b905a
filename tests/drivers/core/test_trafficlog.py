"""drivers.core.trafficlog: logs come back as they were written, and wrong ones are told by line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.base.errors import DriverError
from drivers.core import trafficlog
from drivers.core.trafficlog import Piece, Wire, format_piece, read_log

WIRE = Wire("feetech", 500_000, {1: "sts3215", 252: "sm8512bl"}, "scs0009")
PIECES = st.lists(
    st.tuples(st.integers(0, 10**9), st.sampled_from([True, False, None]), st.binary(min_size=1, max_size=20)),
    max_size=8,
)


@given(PIECES)
def test_a_log_comes_back(rows: list[tuple[int, bool | None, bytes]]) -> None:
    pieces = tuple(Piece(micros / 1e6, sent, data) for micros, sent, data in sorted(rows, key=lambda row: row[0]))
    record = read_log(WIRE.head() + "".join(map(format_piece, pieces)))
    assert record.wire == WIRE and record.pieces == pieces


def test_a_head_is_plain_text() -> None:
    assert Wire(servos={3: "xl330-m288"}).head() == (
        "# omote traffic = 1\n# family = dynamixel\n# baud = 1000000\n# servos = 3:xl330-m288\n"
    )
    text = "# omote traffic = 1\n\n0.5 > ff 00\n# a note\n0.5 < 01\n"
    assert read_log(text).pieces == (Piece(0.5, True, b"\xff\0"), Piece(0.5, False, b"\1"))
    assert read_log(text).wire == Wire()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no record of traffic"),
        ("# something = 1\n0.1 > ff\n", "no record of traffic"),
        ("# omote traffic = 2\n", "newer omote"),
        ("# omote traffic = 1\n# baud = fast\n", "no bit rate"),
        ("# omote traffic = 1\n# baud = 99999999999999999999\n", "no bit rate"),
        ("# omote traffic = 1\n# servos = 1=xl330\n", "servos must be"),
        ("# omote traffic = 1\n0.1 > f\n", "line 2: '0.1 > f'"),
        ("# omote traffic = 1\n0.1 ff\n", "line 2"),
        ("# omote traffic = 1\nnan > ff\n", "times must rise"),
        ("# omote traffic = 1\n0.2 > ff\n0.1 > ff\n", "line 3: times must rise"),
        ("# omote traffic = 1\n0.1 > ff\n0.3 > ff\n0.2 > ff\n", "line 4: times must rise; 0.2 is before 0.3"),
    ],
)
def test_a_wrong_log_is_told(text: str, message: str) -> None:
    with pytest.raises(DriverError, match=message):
        read_log(text)


def test_the_number_of_pieces_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trafficlog, "MAX_PIECES", 2)
    with pytest.raises(DriverError, match="at most 2 pieces"):
        read_log("# omote traffic = 1\n" + "0.1 > ff\n" * 3)
