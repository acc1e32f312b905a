"""controller.robot.fault_script: timelines of faults are read, and every wrong entry is told by its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.robot.fault_script import load_fault_script
from controller.tools.check import check_anything

GOOD = """
name = "bad minute"
loop_s = 60
timeline = [
  "2.0 fault mute:7 late:3:45ms",
  "4 clear mute",
  "4.5 clear",
  "5.0 place 3 -1500",
]
"""


def test_a_timeline_is_read_and_described(tmp_path: Path) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(GOOD)
    timeline = load_fault_script(path)
    assert timeline.steps == (
        (2.0, "fault mute:7 late:3:45ms"), (4.0, "clear mute"), (4.5, "clear"), (5.0, "place 3 -1500"),
    )  # fmt: skip
    assert timeline.loop_s == 60
    assert check_anything(str(path)) == ["timeline of faults faults.toml: 4 entries, again every 60 s: good"]


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("fault mute:7", "begins with a time"),
        ("1 fault mood:7", "there is no fault 'mood'"),
        ("1 fault", "write fault SPEC"),
        ("1 clear mood", "there is no fault 'mood'"),
        ("1 place 3", "write fault SPEC"),
        ("1 place x 3", "write fault SPEC"),
        ("1 place 1 99999999999", "positions go from"),
        ("1 fault mute:0-99999999999", "must be 0 to 252"),
        ("1 servos", "write fault SPEC"),
        ("-1 clear", "begins with a time|times must rise"),
        ("nan clear", "begins with a time"),
        ("90000 clear", "times must rise up to 86400"),
    ],
)
def test_a_wrong_entry_is_told(tmp_path: Path, entry: str, message: str) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(f'timeline = ["0.5 clear", "{entry}"]')
    with pytest.raises(ConfigError, match=rf"timeline\[1\]: .*({message})"):
        load_fault_script(path)


def test_times_rise_and_the_loop_holds_them(tmp_path: Path) -> None:
    path = tmp_path / "faults.toml"
    path.write_text('loop_s = 2\ntimeline = ["3 clear", "2 clear"]')
    with pytest.raises(ConfigError, match=r"2 faults[\s\S]*timeline\[1\][\s\S]*loop_s: 2 is before .* at 3"):
        load_fault_script(path)
    path.write_text("timeline = [" + '"1 clear", ' * 10_001 + "]")
    with pytest.raises(ConfigError, match="at most 10000"):
        load_fault_script(path)


def test_of_a_long_entry_its_first_eighty_letters_are_told(tmp_path: Path) -> None:
    (tmp_path / "faults.toml").write_text(f'name = "a"\ntimeline = ["{"abcdefghij" * 9}"]\n')
    with pytest.raises(ConfigError) as caught:
        load_fault_script(tmp_path / "faults.toml")
    assert f"(is '{'abcdefghij' * 8}')" in str(caught.value)


def test_the_last_entry_counts_for_the_length_of_the_loop(tmp_path: Path) -> None:
    path = tmp_path / "script.toml"
    path.write_text('loop_s = 2\ntimeline = ["1 clear", "3 clear"]')
    with pytest.raises(ConfigError, match=r"loop_s: 2 is before the last entry at 3"):
        load_fault_script(path)
    path.write_text('loop_s = 3\ntimeline = ["1 clear", "3 clear"]')
    assert load_fault_script(path).loop_s == 3
