"""A file is replaced whole or stays as it was."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from controller.base.errors import ControllerError
from controller.base.files import format_fault, replacing


def test_replaces_and_leaves_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "new" / "report.json"
    with replacing(target) as path:
        path.write_text("1")
    with replacing(target) as path:
        path.write_text("2")
    assert target.read_text() == "2"
    assert list(target.parent.iterdir()) == [target]


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "report.json"
    target.write_text("old")
    with pytest.raises(RuntimeError), replacing(target) as path:
        path.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_a_file_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(ControllerError, match="cannot be written") as caught, replacing(tmp_path / "taken" / "x"):
        pass
    assert caught.value.hint


@pytest.mark.parametrize("found", [1, 2, 3])
def test_versions_up_to_the_newest_are_read(found: int) -> None:
    assert format_fault(found, 3) is None


@pytest.mark.parametrize(
    ("found", "says"), [(4, "newer omote"), (0, "from 1"), (None, "from 1"), ("1", "from 1"), (True, "from 1")]
)
def test_others_are_refused_with_what_they_are(found: object, says: str) -> None:
    fault = format_fault(found, 3)
    assert fault is not None and says in fault and repr(found) in fault


def test_a_new_file_has_the_permissions_that_programs_usually_give(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with replacing(tmp_path / "a.json") as path:
            path.write_text("1")
            assert path.parent == tmp_path and path.suffix == ".json" and path.name.startswith(".a-")
        assert os.umask(0o027) == 0o027  # and leaves the mask as it was
    finally:
        os.umask(before)
    assert (tmp_path / "a.json").stat().st_mode & 0o777 == 0o640


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")
def test_a_report_for_a_pipe_or_a_device_does_not_replace_it(tmp_path: Path) -> None:
    target = tmp_path / "report.json"
    os.mkfifo(target)
    reading = os.open(target, os.O_RDONLY | os.O_NONBLOCK)
    try:
        with replacing(target) as path:
            path.write_text("1")
        assert target.is_fifo() and os.read(reading, 10) == b"1"
    finally:
        os.close(reading)


def test_a_full_disk_is_named_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match="No space left") as caught, replacing(tmp_path / "a.json"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert "df -h" in caught.value.hint and not list(tmp_path.iterdir())
