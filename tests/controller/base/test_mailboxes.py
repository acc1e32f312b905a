"""The mailbox carries whole vectors between processes and keeps only the newest."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest

from controller.base import mailboxes
from controller.base.errors import ControllerError
from controller.base.mailboxes import Mailbox

COUNT = 257


def publish_until(pipe: Connection, last: int) -> None:
    """Publish vectors whose entries are all alike, one after the other, as fast as possible."""
    box = Mailbox.receive(pipe, COUNT)
    for number in range(1, last + 1):
        box.publish(np.full(COUNT, float(number)), number)
    box.close()


def test_reads_what_was_published() -> None:
    with Mailbox.create(3) as box:
        out = np.full(3, np.nan)
        assert box.read(out) == (0, 0)
        assert out.tolist() == [0.0, 0.0, 0.0]
        box.publish(np.array([1.0, 2.0, 3.0]), 42)
        box.publish(np.array([4.0, 5.0, 6.0]), 43)
        assert box.read(out) == (2, 43)
        assert out.tolist() == [4.0, 5.0, 6.0]


def test_breath_and_pupils_come_with_the_vector() -> None:
    with Mailbox.create(3) as box:
        out = np.zeros(3)
        box.read(out)
        assert box.life == (0.0, 0.0)
        box.publish(np.array([1.0, 2.0, 3.0]), 42, (2.5, -0.125))
        assert box.life == (0.0, 0.0)  # that of what was read
        assert box.read(out) == (1, 42) and out.tolist() == [1.0, 2.0, 3.0] and box.life == (2.5, -0.125)
        box.publish(out, 43)
        box.read(out)
        assert box.life == (0.0, 0.0)


def test_another_process_gets_the_same_memory_which_has_no_name() -> None:
    before = set(os.listdir(mailboxes.MEMORY))
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs, Mailbox.create(3) as box:
        assert not {name for name in os.listdir(mailboxes.MEMORY) if name.startswith("tmp")} - before
        box.send(ours)
        with Mailbox.receive(theirs, 3) as other:
            other.publish(np.array([1.0, 2.0, 3.0]), 42)
        out = np.zeros(3)
        assert box.read(out) == (1, 42) and out.tolist() == [1.0, 2.0, 3.0]


def test_a_mailbox_that_does_not_come_is_an_error_that_says_so() -> None:
    ours, theirs = multiprocessing.Pipe()
    with theirs, ours:
        ours.send_bytes(b"no mailbox")
        with pytest.raises(ControllerError, match="shared memory of the main process did not come"):
            Mailbox.receive(theirs, 3)
    ours, theirs = multiprocessing.Pipe()
    with theirs, pytest.raises(ControllerError, match="did not come"):
        ours.close()
        Mailbox.receive(theirs, 3)


@pytest.fixture
def full(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Makes a file system in memory that is full; skips where that is not allowed."""
    made: list[Path] = []

    def make(name: str) -> Path:
        folder = tmp_path / name
        folder.mkdir()
        if subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(folder)], capture_output=True
        ).returncode:
            pytest.skip("needs the right to mount a small file system")
        made.append(folder)
        with suppress(OSError):
            (folder / "rest").write_bytes(bytes(2**17))
        return folder

    yield make
    for folder in made:
        subprocess.run(["umount", str(folder)], check=True)


def test_a_full_memory_is_said_before_anything_starts_and_the_disk_is_used(
    full: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = full("memory")
    monkeypatch.setattr(mailboxes, "MEMORY", str(folder))
    with Mailbox.create(600) as box:
        box.publish(np.ones(600))  # ends the process by SIGBUS where the pages are not there
    (said,) = caplog.messages
    assert f"{folder}: No space left on device" in said and tempfile.gettempdir() in said


def test_without_room_anywhere_it_is_an_error_that_names_both(
    full: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    memory, disk = full("memory"), full("disk")
    monkeypatch.setattr(mailboxes, "MEMORY", str(memory))
    monkeypatch.setattr(tempfile, "tempdir", str(disk))
    with pytest.raises(ControllerError, match=f"{memory}: No space left on device; {disk}: No space left") as caught:
        Mailbox.create(600)
    assert str(memory) in caught.value.hint


def test_a_file_that_takes_only_some_of_the_bytes_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(ControllerError, match="no room for 9680 bytes"):
            Mailbox.create(601)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.slow
def test_no_torn_vector_from_another_process() -> None:
    last = 30_000
    with Mailbox.create(COUNT) as box:
        ours, theirs = multiprocessing.Pipe()
        writer = multiprocessing.get_context("spawn").Process(target=publish_until, args=(theirs, last))
        writer.start()
        box.send(ours)
        out = np.zeros(COUNT)
        seen = stamp = 0
        while stamp < last and (writer.is_alive() or box.sequence < last or stamp < last):
            sequence, stamp = box.read(out)
            assert sequence >= seen
            assert (out == out[0]).all()
            assert stamp == int(out[0])
            seen = sequence
        writer.join()
        ours.close()
        theirs.close()
        assert seen == last


def test_a_vector_without_a_stamp_has_none() -> None:
    with Mailbox.create(2) as box:
        out = np.zeros(2)
        box.publish(np.ones(2), 7)
        box.publish(np.array([3.0, 4.0]))
        assert box.read(out) == (2, 0) and out.tolist() == [3.0, 4.0]
        assert box.sequence == 2
