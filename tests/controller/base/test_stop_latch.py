"""STOP holds until START, and the first one to stop is the one reported."""

from controller.base.stop_latch import StopLatch, Stopped


def test_a_latch_begins_released() -> None:
    latch = StopLatch()
    assert latch.stopped is None
    assert latch.start() is False


def test_the_first_stop_is_kept_until_start() -> None:
    latch = StopLatch()
    assert latch.stop("panel", 5) is True
    assert latch.stop("line /dev/ttyUSB0", 9) is False
    assert latch.stopped == Stopped("panel", 5)
    assert latch.start() is True
    assert latch.stopped is None


def test_every_stop_is_counted_once() -> None:
    latch = StopLatch()
    for at_ns in range(3):
        latch.stop("panel", at_ns)
        latch.stop("panel", at_ns)
        latch.start()
    assert latch.stops == 3
