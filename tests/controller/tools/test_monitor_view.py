"""controller.tools.monitor_view: what passed becomes lines, what is becomes a table."""

from __future__ import annotations

import io
import struct

from rich.console import Console

from controller.tools.monitor_view import KEPT, BusView, table_of
from drivers.core.traffic import Decoder2
from drivers.packets.packet import encode_instruction
from drivers.tables.tables import load_table

WRITE = encode_instruction(3, 3, struct.pack("<HI", 116, 2048))


def watch(console: Console | None = None, lines: int = 16) -> BusView:
    decoder = Decoder2({3: load_table("xl330-m288")})
    rows = [{"id": 3, "position": 2047.0, "torque": True, "age": float("nan")}]
    return BusView("simulated bus", lambda: rows, decoder, console or Console(file=io.StringIO()), lines)


def shown(view: BusView, width: int = 100) -> str:
    """One refresh of a terminal."""
    screen = io.StringIO()
    asked = iter([True, False])
    view._console = Console(file=screen, force_terminal=True, width=width)
    view.run(lambda: next(asked))
    return screen.getvalue()


def test_bytes_become_lines_with_their_time() -> None:
    view = watch()
    view.tap(True, WRITE[:5])
    view.tap(True, WRITE[5:])
    (line,) = view.lines()
    assert line.split(maxsplit=1)[1] == "-> 3 write Goal Position = 2048"
    assert view.lines() == []


def test_without_a_terminal_lines_are_printed_once() -> None:
    out = io.StringIO()
    view = watch(Console(file=out))
    view.tap(True, WRITE)
    asked = iter([True, True, False])
    view.run(lambda: next(asked))
    assert out.getvalue().count("write Goal Position = 2048") == 1


def test_a_terminal_shows_servos_and_the_last_lines_only() -> None:
    view = watch(lines=2)
    for _ in range(5):
        view.tap(True, WRITE)
    screen = shown(view)
    assert "simulated bus" in screen
    assert screen.split("simulated bus")[-1].count("write Goal Position") <= 2
    assert "2047.0" in screen


def test_a_bus_that_is_faster_than_the_view_is_told() -> None:
    view = watch()
    for _ in range(KEPT + 7):
        view.tap(True, WRITE)
    assert "7 pieces left out" in shown(view)


def test_tables_take_any_columns_and_leave_unknown_cells_empty() -> None:
    table = table_of([{"id": 1, "torque": False}, {"id": 2, "load": 0.25}])
    assert [column.header for column in table.columns] == ["id", "torque", "load"]
    assert [list(column.cells) for column in table.columns] == [["1", "2"], ["off", ""], ["", "0.2"]]
