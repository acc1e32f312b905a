"""Runs a link of a stage as a part that fails separately: it is reopened after an error of opening or of a thread."""

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

_CLOSE_TIMEOUT_S = 3.0
_MAX_STATUS_LENGTH = 1200
"""Characters for all links in an answer to STATUS, which has at most 2048."""
_MAX_FAULT_LENGTH = 80
"""Characters for the fault of one link."""
_DEFAULT_HOOK = threading.excepthook


class LinkPart:
    """A link that may fail and is reopened; it always closes what it opened.

    choice : its settings. context : creates the link's context, which adds to the given closers.
    """

    def __init__(self, choice: LinkSettings, context: Callable[[Closers], LinkContext], parts: Parts) -> None:
        self._choice, self._context, self.name = choice, context, f"link {choice}"
        self._part = parts.add(Part(self.name, keep_trying=True))
        self._link: Link | None = None
        self._closers = Closers()
        self._threads: set[threading.Thread] = set()
        self._stopping = threading.Event()
        self._lock = threading.Lock()  # held while the link is reopened or closed
        self._state_lock = threading.Lock()  # protects the next two attributes
        self._reopening = False
        self._late_error: BaseException | None = None  # of a thread that failed while the link was being reopened

    @property
    def opened(self) -> bool:
        """Whether the link is open and has not failed."""
        return self._link is not None and not self._part.failed

    def open(self) -> None:
        """Open the link. Raises what its kind raises; then everything that was opened is closed again."""
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
        """Report an error of the link, and reopen it after a pause, in another thread."""
        with self._state_lock:
            if self._reopening:  # a second thread of the link failed
                self._late_error = error
                return
            self._reopening = True
        self._part.fail(error, time.monotonic())
        threading.Thread(target=self._reopen, name=f"{self.name}, again", daemon=True).start()

    def close(self) -> None:
        """Close the link; if that takes longer than a few seconds, report it and do not wait."""
        self._stopping.set()
        if self._lock.acquire(timeout=_CLOSE_TIMEOUT_S):
            self._end(self._closers)
            self._lock.release()

    def report(self) -> dict[str, object]:
        """Return the link's own report or, if it is not open or its report fails, one with ``fault``."""
        empty: dict[str, object] = {"port": str(self._choice), "accepted": 0, "refused": {}}
        if self._link is None:
            return {**empty, "fault": self._part.why}
        try:
            return {**empty, **self._link.report()}
        except Exception as error:  # noqa: BLE001  a broken report of one link must not spoil the run's report
            return {**empty, "fault": f"its report failed: {describe(error)}"}

    def record(self) -> dict[str, object]:
        """Return the report with a ``name`` for people: its kind, and the address at which it really listens."""
        report = self.report()
        where, name = str(report["port"]), str(self._choice)
        return {"name": name if where in ("", name) else f"{self._choice.kind} on {where}", **report}

    def _reopen(self) -> None:
        while not self._stopping.wait(self._part.pause_s):
            with self._lock:
                if self._stopping.is_set():
                    return
                self._end(self._closers)
                with self._state_lock:
                    self._late_error = None  # errors of the closed link's threads no longer matter
                try:
                    self.open()
                except Exception as error:  # noqa: BLE001  the loop tries again
                    self._part.fail(error, time.monotonic())
                    continue
            with self._state_lock:
                late_error = self._late_error
                if late_error is None:
                    self._reopening = False
                    self._part.recover()
                    return
            self._part.fail(late_error, time.monotonic())

    def _end(self, closers: Closers) -> None:
        """Close the link in another thread, so that a link that hangs does not keep the servos from stopping."""
        thread = threading.Thread(target=self._run_closers, args=(closers,), name=f"{self.name}, end", daemon=True)
        thread.start()
        thread.join(_CLOSE_TIMEOUT_S)
        if thread.is_alive():
            self._part.note(f"it did not close within {_CLOSE_TIMEOUT_S:g} s")

    def _run_closers(self, closers: Closers) -> None:
        try:
            closers.close()
        except Exception as error:  # noqa: BLE001  reported, since the caller must go on
            self._part.note(f"it could not be closed in order: {describe(error)}")


def link_status(links: Sequence[LinkPart]) -> dict[str, str]:
    """Return rate, jitter, loss, age and last error of each receiving link, as one word under ``links``.

    It is empty if no link receives. If there is no room for all links, the last entry gives the number of the others.
    """
    words = [_link_word(link.name, report) for link in links if "rate_hz" in (report := link.report())]
    kept = [*words]
    while sum(len(word) + 1 for word in kept) > _MAX_STATUS_LENGTH:
        kept.pop()
    more = [f"and_{len(words) - len(kept)}_more"] if len(kept) < len(words) else []
    return {"links": ";".join([*kept, *more])} if words else {}


def _link_word(name: str, report: dict[str, Any]) -> str:
    """Return the report of one link as a word without spaces and semicolons."""
    age = "never" if report["age_s"] is None else f"{report['age_s']}s"
    fault = str(report.get("fault") or report["error"] or "good")[:_MAX_FAULT_LENGTH]
    figures = f"{report['rate_hz']}Hz,{report['jitter_ms']}ms,lost={report['lost']},age={age},{fault}"
    return "_".join(f"{name.removeprefix('link ')}:{figures}".replace(";", ",").split())


@contextmanager
def thread_errors(links: Callable[[], list[LinkPart]], parts: Parts) -> Iterator[None]:
    """Attribute an error that ends a thread to the link that started it, else to a part named after the thread."""
    before = threading.excepthook

    def hook(dropped: Any) -> None:
        error = dropped.exc_value or dropped.exc_type()
        for link in links():
            if link.owns(dropped.thread):
                link.fail(error)
                return
        if before is not _DEFAULT_HOOK:  # the hook of another head, whose link may own the thread
            before(dropped)
            return
        name = f"thread {dropped.thread.name}" if dropped.thread is not None else "a thread"
        parts.add(Part(name, remedy="it comes back with the next start")).fail(error, time.monotonic())

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before
