"""Lines that wait to be sent."""

from __future__ import annotations

from controller.links.line.outbox import MAX_BYTES, Outbox


def test_lines_leave_in_order_in_pieces_of_any_size() -> None:
    outbox, sent = Outbox(), b""
    assert outbox.flush(len) == 0 and not outbox
    for line in (b"one\n", b"two\n", b"three\n"):
        assert outbox.add(line, answer=True)
    while outbox:

        def put(data: bytes) -> int:
            nonlocal sent
            sent += data[:3]
            return min(3, len(data))

        assert outbox.flush(put) in (2, 3)
    assert sent == b"one\ntwo\nthree\n"


def test_only_what_has_room_is_taken_and_streamed_lines_never_wait() -> None:
    outbox = Outbox()
    assert outbox.add(b"P 1 a=0\n", answer=False) and not outbox.add(b"P 2 a=0\n", answer=False)
    assert outbox.add(b"x" * (MAX_BYTES - 8), answer=True) and not outbox.add(b"y", answer=True)
    outbox.flush(lambda data: 9)
    assert outbox.add(b"y" * 9, answer=True) and not outbox.add(b"y", answer=True)


def test_what_is_discarded_counts_the_answers_that_were_not_sent_whole() -> None:
    outbox = Outbox()
    outbox.add(b"P 1 a=0\n", answer=False)
    for line in (b"one\n", b"two\n", b"three\n"):
        outbox.add(line, answer=True)
    outbox.flush(lambda data: 14)  # the streamed line, the first answer and half of the second
    assert outbox.clear() == 2 and not outbox and outbox.clear() == 0
    assert outbox.add(b"x" * MAX_BYTES, answer=True)
