"""surface.base.writing: files are replaced whole or not at all, and what is no file is never replaced."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from surface.base.writing import replacing

posix = pytest.mark.skipif(os.name != "posix", reason="links, pipes and permissions of POSIX")


def write(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(text)


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write(path, "old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "name", ["顔" * 83 + ".json", "a" * 250 + ".json", "take." + "b" * 250, "😀" * 60 + "." + "😀" * 3]
)
def test_names_may_be_as_long_as_the_file_system_takes_them(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    try:
        path.write_text("old")
    except OSError:
        pytest.skip("the file system takes no such name")
    write(path, "new")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


@posix
def test_a_pipe_stays_a_pipe_and_gets_the_content(tmp_path: Path) -> None:
    path, got = tmp_path / "pipe.json", list[str]()
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: got.append(path.read_text()), daemon=True)
    reader.start()
    write(path, "report")
    assert stat.S_ISFIFO(path.stat().st_mode)
    reader.join(10.0)
    assert got == ["report"] and list(tmp_path.iterdir()) == [path]


@posix
def test_a_device_stays_a_device_and_gets_the_content(tmp_path: Path) -> None:
    master, slave = os.openpty()
    try:
        path = tmp_path / "stdout"
        path.symlink_to(os.ttyname(slave))
        write(path, "report")
        assert os.read(master, 100) == b"report"
        assert path.is_symlink() and stat.S_ISCHR(path.stat().st_mode)
    finally:
        os.close(slave)
        os.close(master)


@posix
def test_a_link_stays_and_its_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    real, path = tmp_path / "kept" / "desk.toml", tmp_path / "robot.toml"
    real.write_text("old")
    path.symlink_to(Path("kept") / "desk.toml")
    write(path, "new")
    assert path.is_symlink() and real.read_text() == "new"
    assert list((tmp_path / "kept").iterdir()) == [real]


@posix
def test_a_link_to_a_file_that_is_not_there_yet_makes_it(tmp_path: Path) -> None:
    path = tmp_path / "link"
    path.symlink_to("real")
    write(path, "new")
    assert path.is_symlink() and (tmp_path / "real").read_text() == "new"


@posix
def test_the_permissions_of_a_private_file_stay_and_hold_while_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "person.csv"
    write(path, "old")
    path.chmod(0o600)
    with replacing(path) as temporary:
        assert temporary.stat().st_mode & 0o777 == 0o600
        temporary.write_text("new")
    assert path.stat().st_mode & 0o777 == 0o600


@posix
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may give files away")
def test_root_leaves_a_file_to_its_owner(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    write(path, "old")
    os.chown(path, 65_534, 65_534)
    write(path, "new")
    assert (path.stat().st_uid, path.stat().st_gid) == (65_534, 65_534)


def test_a_name_as_long_as_a_name_may_be(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 250 + ".json")
    write(path, "new")
    assert path.read_text() == "new"


@posix
def test_a_long_name_of_characters_of_many_bytes(tmp_path: Path) -> None:
    path = tmp_path / ("表" * 80 + ".json")
    write(path, "new")
    assert path.read_text() == "new"


PRINTS = """
from pathlib import Path
from surface.base.writing import replacing
print("before")
with replacing(Path("/dev/stdout")) as temporary:
    temporary.write_text("report\\n")
print("after")
"""


@posix
@pytest.mark.parametrize(("mode", "kept"), [("a", "old\n"), ("w", "")])
def test_a_file_into_which_standard_output_goes_keeps_what_is_in_it(tmp_path: Path, mode: str, kept: str) -> None:
    path = tmp_path / "log.txt"
    path.write_text("old\n")
    with path.open(mode) as output:
        subprocess.run([sys.executable, "-c", PRINTS], stdout=output, check=True)
    assert path.read_text() == f"{kept}before\nreport\nafter\n"


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(OSError, match="taken"):
        write(tmp_path / "taken", "new")
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken"]
