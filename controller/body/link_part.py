"""A link of a stage as a part: it is opened again where that fails, or where one of its threads ends by an error."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from controller.base.parts import Part, Parts, describe
from controller.links.kind import Link, LinkContext
from controller.links.links import LinkSettings, open_links
from drivers.base.shutdown import Closers

_CLOSE_S = 3.0
_LONGEST_STATUS, _LONGEST_FAULT = 1200, 80
"""Characters of all links in an answer to STATUS, which has at most 2048, and of what is wrong with one."""
_PLAIN_HOOK = threading.excepthook


class LinkPart:
    """A link that may fail; closes what it opened, whatever state that is in.

    choice : its settings. context : makes what the link gets, with what closes it.

    Attributes
    ----------
    opened : whether the link is there.
    """

    def __init__(self, choice: LinkSettings, context: Callable[[Closers], LinkContext], parts: Parts) -> None:
        self._choice, self._context, self.name = choice, context, f"link {choice}"
        self._part = parts.add(Part(self.name, keep_trying=True))
        self._link: Link | None = None
        self._closers = Closers()
        self._threads: set[threading.Thread] = set()
        self._stopping = threading.Event()
        self._lock = threading.Lock()  # held while it is opened and closed
        self._guard = threading.Lock()  # of the two below
        self._reopening = False
        self._late_error: BaseException | None = None  # of a thread that ended while the link was opened again

    @property
    def opened(self) -> bool:
        """Whether the link is there."""
        return self._link is not None and not self._part.failed

    def open(self) -> None:
        """Open the link. Raises whatever its kind raises; what was opened is closed again then."""
        before = set(threading.enumerate())
        closers = Closers()
        try:
            (self._link,) = open_links([self._choice], self._context(closers))
        except BaseException:
            self._end(closers)
            raise
        finally:
            self._threads = set(threading.enumerate()) - before
        self._closers = closers

    def owns(self, thread: threading.Thread | None) -> bool:
        """Whether the link started a thread while it was opened."""
        return thread in self._threads

    def fail(self, error: BaseException) -> None:
        """Report an error of the link, and open it again after a pause."""
        with self._guard:
            if self._reopening:  # another of its threads ended, too
                self._late_error = error
                return
            self._reopening = True
        self._part.fail(error, time.monotonic())
        threading.Thread(target=self._open_again, name=f"{self.name}, again", daemon=True).start()

    def close(self) -> None:
        """Close the link; one that does not end within a few seconds is reported and left behind."""
        self._stopping.set()
        if self._lock.acquire(timeout=_CLOSE_S):
            self._end(self._closers)
            self._lock.release()

    def report(self) -> dict[str, object]:
        """The link's own report, with why it failed where it did."""
        empty: dict[str, object] = {"port": str(self._choice), "accepted": 0, "refused": {}}
        if self._link is None:
            return {**empty, "fault": self._part.why}
        try:
            return {**empty, **self._link.report()}
        except Exception as error:  # noqa: BLE001  the rest of the report is still good
            return {**empty, "fault": f"its report failed: {describe(error)}"}

    def record(self) -> dict[str, object]:
        """The report with its ``name`` for people: its kind, and where it really listens."""
        report = self.report()
        where, name = str(report["port"]), str(self._choice)
        return {"name": name if where in ("", name) else f"{self._choice.kind} on {where}", **report}

    def _open_again(self) -> None:
        while not self._stopping.wait(self._part.pause_s):
            with self._lock:
                if self._stopping.is_set():
                    return
                self._end(self._closers)
                with self._guard:
                    self._late_error = None  # of threads of the link that was ended
                try:
                    self.open()
                except Exception as error:  # noqa: BLE001  tried again
                    self._part.fail(error, time.monotonic())
                    continue
            with self._guard:
                again = self._late_error
                if again is None:
                    self._reopening = False
                    self._part.recover()
                    return
            self._part.fail(again, time.monotonic())

    def _end(self, closers: Closers) -> None:
        """Run what closes the link, in another thread: what hangs there must not keep the servos from stopping."""
        thread = threading.Thread(target=self._run_closers, args=(closers,), name=f"{self.name}, end", daemon=True)
        thread.start()
        thread.join(_CLOSE_S)
        if thread.is_alive():
            self._part.note(f"it did not close within {_CLOSE_S:g} s")

    def _run_closers(self, closers: Closers) -> None:
        try:
            closers.close()
        except Exception as error:  # noqa: BLE001  the others are closed all the same
            self._part.note(f"it could not be closed in order: {describe(error)}")


def link_status(links: Sequence[LinkPart]) -> dict[str, str]:
    """Rate, jitter, loss, age and last error of each link that takes anything, as one word; nothing without any.

    Where there is no room for all of them, the last entry says how many more there are.
    """
    words = [_figures(link.name, report) for link in links if "rate_hz" in (report := link.report())]
    kept = [*words]
    while sum(len(word) + 1 for word in kept) > _LONGEST_STATUS:
        kept.pop()
    more = [f"and_{len(words) - len(kept)}_more"] if len(kept) < len(words) else []
    return {"links": ";".join([*kept, *more])} if words else {}


def _figures(name: str, report: dict[str, Any]) -> str:
    """One link as a word."""
    age = "never" if report["age_s"] is None else f"{report['age_s']}s"
    fault = str(report.get("fault") or report["error"] or "good")[:_LONGEST_FAULT]
    figures = f"{report['rate_hz']}Hz,{report['jitter_ms']}ms,lost={report['lost']},age={age},{fault}"
    return "_".join(f"{name.removeprefix('link ')}:{figures}".replace(";", ",").split())


@contextmanager
def thread_errors(links: Callable[[], list[LinkPart]], parts: Parts) -> Iterator[None]:
    """Context in which an error that ends any thread becomes that of the link that started it, or of a part of the
    thread's name.
    """
    before = threading.excepthook

    def hook(dropped: Any) -> None:
        error = dropped.exc_value or dropped.exc_type()
        for link in links():
            if link.owns(dropped.thread):
                link.fail(error)
                return
        if before is not _PLAIN_HOOK:  # that of another head, whose link it may be
            before(dropped)
            return
        name = f"thread {dropped.thread.name}" if dropped.thread is not None else "a thread"
        parts.add(Part(name, remedy="it comes back with the next start")).fail(error, time.monotonic())

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before
