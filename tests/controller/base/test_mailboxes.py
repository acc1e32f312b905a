"""The mailbox carries whole vectors between processes and keeps only the newest."""

from __future__ import annotations

import multiprocessing
import sys
from pathlib import Path

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox

COUNT = 257


def publish_until(path: str, last: int) -> None:
    """Publish vectors whose entries are all alike, one after the other, as fast as possible."""
    box = Mailbox(path, COUNT)
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


def test_the_file_goes_with_its_maker() -> None:
    box = Mailbox.create(3)
    other = Mailbox(box.path, 3)
    other.close()
    assert Path(box.path).exists()
    box.close()
    assert not Path(box.path).exists()


@pytest.mark.skipif(sys.platform == "win32", reason="a file in use cannot be removed there")
def test_without_a_name_the_memory_is_shared_as_before() -> None:
    with Mailbox.create(3) as box, Mailbox(box.path, 3) as other:
        other.unlink()
        other.unlink()
        assert not Path(box.path).exists()
        other.publish(np.array([1.0, 2.0, 3.0]), 42)
        out = np.zeros(3)
        assert box.read(out) == (1, 42) and out.tolist() == [1.0, 2.0, 3.0]


def test_no_torn_vector_from_another_process() -> None:
    last = 30_000
    with Mailbox.create(COUNT) as box:
        writer = multiprocessing.get_context("spawn").Process(target=publish_until, args=(box.path, last))
        writer.start()
        out = np.zeros(COUNT)
        seen = stamp = 0
        while stamp < last and (writer.is_alive() or box.sequence < last or stamp < last):
            sequence, stamp = box.read(out)
            assert sequence >= seen
            assert (out == out[0]).all()
            assert stamp == int(out[0])
            seen = sequence
        writer.join()
        assert seen == last


def test_a_vector_without_a_stamp_has_none() -> None:
    with Mailbox.create(2) as box:
        out = np.zeros(2)
        box.publish(np.ones(2), 7)
        box.publish(np.array([3.0, 4.0]))
        assert box.read(out) == (2, 0) and out.tolist() == [3.0, 4.0]
        assert box.sequence == 2
