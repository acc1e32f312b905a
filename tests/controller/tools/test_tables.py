"""controller.tools.tables in the monitor: a narrow terminal shows every value of every servo."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from controller.tools.monitor import BusView, make_decoder

ROW = {
    "id": 12, "model": "xl330-m288", "position deg": -123.4, "speed deg/s": 234.5, "current A": "0.123",
    "supply V": 11.1, "temp. C": 41.0, "torque": True, "state": "hardware error 0x20",
}  # fmt: skip


@pytest.mark.parametrize("width", [60, 80, 200])
def test_no_value_of_a_servo_and_no_packet_is_cut(width: int) -> None:
    out = io.StringIO()
    console = Console(file=out, width=width, color_system=None)
    view = BusView("/dev/ttyUSB0 at 57600 baud", lambda: [ROW], make_decoder(2, {}), console)
    view._log.append("    0.123  > 12 write " + " ".join(f"{i:02x}" for i in range(60)) + " end")
    console.print(view._picture())
    text = out.getvalue()
    assert max(map(len, text.splitlines())) <= width
    words = text.replace(";", " ").split()
    for word in ("12", "xl330-m288", "-123.4", "234.5", "0.123", "11.1", "41.0", "on", "hardware", "0x20", "3b", "end"):
        assert word in words, (word, text)
    assert "…" not in text
