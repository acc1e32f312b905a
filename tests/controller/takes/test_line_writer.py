"""Lines on a disk that fills up."""

from __future__ import annotations

import resource
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.takes import line_writer
from controller.takes.line_writer import LineWriter
from controller.takes.recording import recorded, replay


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """No file of this process may become longer."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_lines_are_written_in_order(tmp_path: Path) -> None:
    path, failed = tmp_path / "a", list[Exception]()
    path.write_text("what was there before")
    writer = LineWriter(path, failed.append)
    for i in range(1000):
        writer.put(b"%d\n" % i)
    writer.close()
    assert path.read_text().split() == [str(i) for i in range(1000)] and failed == [] and writer.error is None


def test_a_full_disk_keeps_the_whole_lines_and_is_told_once(tmp_path: Path) -> None:
    path, failed = tmp_path / "a", list[Exception]()
    with files_up_to(1000):
        writer = LineWriter(path, failed.append)
        for _ in range(100):
            writer.put(b"123456789012345678901\n")
        writer.close()
        writer.put(b"nobody waits for this\n")
    assert path.read_bytes() == b"123456789012345678901\n" * 45
    assert [str(error) for error in failed] == [f"[Errno 27] File too large: '{path}'"]


def test_a_device_without_room_is_told(tmp_path: Path) -> None:
    failed: list[Exception] = []
    writer = LineWriter(Path("/dev/full"), failed.append)
    writer.put(b"a\n")
    writer.close()
    assert [str(error) for error in failed] == ["[Errno 28] No space left on device: '/dev/full'"]


def test_a_disk_that_does_not_keep_up_is_told_and_nobody_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hold, failed = threading.Event(), list[Exception]()
    monkeypatch.setattr(line_writer, "_MAX_PENDING_LINES", 10)
    monkeypatch.setattr(LineWriter, "_write", lambda _: hold.wait(60.0))
    writer = LineWriter(tmp_path / "a", failed.append)
    for _ in range(12):
        writer.put(b"a\n")
    hold.set()
    writer.close()
    assert len(failed) == 1 and "the disk does not keep up" in str(failed[0])


class _ErrorReadAtOnce(LineWriter):
    """A writer whose ``error`` is read by two failing threads at the same time, unless a lock keeps them apart."""

    barrier: threading.Barrier | None = None
    stored: OSError | None = None

    @property  # type: ignore[override]
    def error(self) -> OSError | None:
        found = self.stored
        if self.barrier is not None:
            with suppress(threading.BrokenBarrierError):
                self.barrier.wait(0.2)
        return found

    @error.setter
    def error(self, error: OSError | None) -> None:
        self.stored = error


def test_errors_of_two_threads_are_told_once(tmp_path: Path) -> None:
    failed: list[Exception] = []
    writer = _ErrorReadAtOnce(tmp_path / "a", failed.append)
    writer.close()
    writer.barrier = threading.Barrier(2)
    threads = [threading.Thread(target=writer._fail, args=(OSError(number, "no"),)) for number in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(failed) == 1


def test_a_recording_that_met_a_full_disk_can_be_played_as_far_as_it_goes(tmp_path: Path) -> None:
    path, state, out = tmp_path / "a.rec", CommandState(P), P.neutral()
    with files_up_to(20_000), pytest.raises(ControllerError, match=r"a\.rec: cannot be written: File too large"):
        with recorded(state, path):
            state.set_parameters([3], [0.5], 0)
            for i in range(1000):
                state.tick(10**9 + i * 10_000_000, 0.01, out)
        assert state.status()["ticks"] == 1000
    assert 100 < len(list(replay(path, P))) < 1000
