"""Links that fail: while they are opened, in a thread of their own, in their report, and while they are closed."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS
from controller.base.parts import Parts
from controller.body import link_part
from controller.body.link_part import LinkPart, link_status, thread_errors
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import read_link
from drivers.base.shutdown import Closers


def until(condition: Callable[[], object]) -> None:
    for _ in range(6000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("waited in vain")


class Foreign:
    """A link of another package: its thread works until it is told to raise."""

    def __init__(self, context: LinkContext) -> None:
        self.said: dict[str, object] = {"port": "far", "accepted": 7, "refused": {}}
        self._go, self.trouble = threading.Event(), Exception("nothing")
        self.thread = threading.Thread(target=self._run, name="foreign", daemon=True)
        self.thread.start()
        context.closers.callback(self.end)

    def _run(self) -> None:
        if self._go.wait(60.0):
            raise self.trouble

    def raise_in_thread(self, error: Exception) -> None:
        self.trouble = error
        self._go.set()

    def end(self) -> None:
        self.ended = True

    def report(self) -> dict[str, object]:
        if isinstance(self.said, Exception):
            raise self.said
        return self.said


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The links that were opened; exceptions put in front are raised instead."""
    links: list[Any] = []
    waiting: list[Exception] = []

    def start(choices: Any, context: LinkContext) -> list[Any]:
        if waiting:
            raise waiting.pop(0)
        links.append(Foreign(context))
        return links[-1:]

    monkeypatch.setattr(link_part, "open_links", start)
    monkeypatch.setattr("controller.base.parts.PAUSES_S", (0.01,) * 5)
    links_and_waiting: Any = links
    monkeypatch.setattr(Foreign, "waiting", waiting, raising=False)
    return cast(list[Any], links_and_waiting)


@pytest.fixture
def link(made: list[Any]) -> Iterator[LinkPart]:
    parts = Parts()

    def context(closers: Closers) -> LinkContext:
        return LinkContext(cast(Any, None), closers)

    part = LinkPart(cast(Any, "foreign on far"), context, parts)
    with thread_errors(lambda: [part], parts):
        part.open()
        yield part
    part.close()


def test_an_error_that_ends_a_thread_of_a_link_closes_it_and_opens_it_again(
    link: LinkPart, made: list[Any], caplog: pytest.LogCaptureFixture
) -> None:
    assert link.opened
    made[0].raise_in_thread(ValueError("no such face"))
    until(lambda: len(made) == 2 and link.opened)
    assert made[0].ended
    assert caplog.messages == [
        "link foreign on far failed: ValueError: no such face; it starts again in 0.01 s",
        "link foreign on far works again",
    ]
    assert link.report() == made[1].said


def test_two_threads_of_one_link_that_end_open_it_again_once(
    link: LinkPart, made: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("controller.base.parts.PAUSES_S", (0.1,) * 5)
    link.fail(OSError("receiver"))
    link.fail(OSError("sender"))
    until(lambda: link.opened)
    time.sleep(0.3)
    assert len(made) == 2 and link.opened and link._part.failures == 1
    link.fail(OSError("again"))
    until(lambda: len(made) == 3 and link.opened)
    assert link._part.failures == 2


def test_a_link_that_fails_while_it_is_opened_again_is_opened_once_more(
    link: LinkPart, made: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("controller.base.parts.PAUSES_S", (0.01,) * 5)
    real = link.open

    def open_and_fail() -> None:
        real()
        if len(made) == 2:
            link.fail(OSError("at once"))

    monkeypatch.setattr(link, "open", open_and_fail)
    link.fail(OSError("first"))
    until(lambda: len(made) == 3 and link.opened)
    assert link._part.failures == 2 and made[1].ended


def test_a_link_that_does_not_come_up_is_tried_again_for_ever(
    link: LinkPart, made: list[Any], caplog: pytest.LogCaptureFixture
) -> None:
    Foreign.waiting[:] = [LinkError("nobody there", hint="plug it in")] * 9  # type: ignore[attr-defined]
    link.fail(LinkError("nobody there", hint="plug it in"))
    assert not link.opened
    until(lambda: link.opened)
    assert caplog.messages == [
        "link foreign on far failed: nobody there (plug it in); it starts again in 0.01 s",
        "link foreign on far works again",
    ]
    assert link._part.failures == 10 and len(made) == 2


def test_a_report_that_raises_says_so_and_leaves_the_others_alone(link: LinkPart, made: list[Any]) -> None:
    made[0].said = KeyError("port")
    assert link.report() == {
        "port": "foreign on far", "accepted": 0, "refused": {}, "fault": "its report failed: KeyError: 'port'",
    }  # fmt: skip


def test_a_link_that_hangs_while_it_is_closed_does_not_keep_the_servos_waiting(
    link: LinkPart, made: list[Any], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link_part, "_CLOSE_TIMEOUT_S", 0.05)
    release = threading.Event()
    link._closers.callback(lambda: release.wait(60.0))
    link.close()
    release.set()
    assert caplog.messages == ["link foreign on far: it did not close within 0.05 s"]


def test_a_link_that_raises_while_it_is_closed_is_reported(link: LinkPart, caplog: pytest.LogCaptureFixture) -> None:
    def trouble() -> None:
        raise OSError(5, "Input/output error")

    link._closers.callback(trouble)
    link.close()
    assert caplog.messages == ["link foreign on far: it could not be closed in order: Input/output error"]


def test_a_thread_of_nobody_is_reported_by_its_name(link: LinkPart, caplog: pytest.LogCaptureFixture) -> None:
    def trouble() -> None:
        raise ValueError("lost")

    thread = threading.Thread(target=trouble, name="stray")
    thread.start()
    thread.join()
    assert caplog.messages == ["thread stray failed: ValueError: lost; it comes back with the next start"]
    assert link.opened


def test_what_was_opened_before_an_error_is_closed(made: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def half(choices: Any, context: LinkContext) -> list[Any]:
        made.append(Foreign(context))
        raise LinkError("only half")

    monkeypatch.setattr(link_part, "open_links", half)
    part = LinkPart(cast(Any, "x"), lambda closers: LinkContext(cast(Any, None), closers), Parts())
    with pytest.raises(LinkError, match="only half"):
        part.open()
    assert made[0].ended and not part.opened
    assert part.report() == {"port": "x", "accepted": 0, "refused": {}, "fault": ""}
    part.close()


class Told:
    """A link part with a report."""

    def __init__(self, name: str, report: dict[str, object]) -> None:
        self.name, self._report = name, report

    def report(self) -> dict[str, object]:
        return self._report


def test_status_has_the_figures_of_links_that_take_faces_as_one_word() -> None:
    figures = {"rate_hz": 60.0, "jitter_ms": 0.4, "lost": 2, "age_s": 0.012, "error": ""}
    links = [
        Told("link livelink on udp:127.0.0.1:11111", figures),
        Told("link foreign on far", {"accepted": 5}),
        Told("link vmc on udp:127.0.0.1:5", {**figures, "age_s": None, "error": "the far end hung up"}),
    ]
    assert link_status(cast(Any, links)) == {
        "links": "livelink_on_udp:127.0.0.1:11111:60.0Hz,0.4ms,lost=2,age=0.012s,good;"
        "vmc_on_udp:127.0.0.1:5:60.0Hz,0.4ms,lost=2,age=never,the_far_end_hung_up"
    }
    assert link_status(cast(Any, links[1:2])) == {}


def test_status_says_how_many_links_it_has_no_room_for() -> None:
    figures = {"rate_hz": 60.0, "jitter_ms": 0.4, "lost": 0, "age_s": 0.012, "error": "an; error " * 50}
    (word,) = link_status(cast(Any, [Told(f"link vmc on udp:127.0.0.1:{n}", figures) for n in range(40)])).values()
    *kept, more = word.split(";")
    assert len(word) < 1300 and len(kept) >= 5 and more == f"and_{40 - len(kept)}_more"
    assert all(each.startswith(f"vmc_on_udp:127.0.0.1:{n}:60.0Hz") for n, each in enumerate(kept))


@pytest.mark.parametrize("kind", ["websocket", "line", "web"])
def test_a_link_at_a_port_that_the_system_chooses_says_which_it_is(kind: str) -> None:
    parts, state = Parts(), CommandState(PARAMETERS)
    choice = read_link({"kind": kind, "listen": "127.0.0.1:0"})
    part = LinkPart(choice, lambda closers: LinkContext(cast(Any, state), cast(Any, closers)), parts)
    assert part.record()["name"] == f"{kind} on 127.0.0.1:0"
    part.open()
    try:
        said = str(part.record()["name"])
        host, _, port = said.removeprefix(f"{kind} on ").rpartition(":")
        assert host == "127.0.0.1" and part.report()["port"] == f"{host}:{port}"
        with socket.create_connection((host, int(port)), 10.0):
            pass
    finally:
        part.close()


def test_a_foreign_link_is_named_by_its_kind_and_where_it_says_it_is(made: list[Any]) -> None:
    choice = SimpleNamespace(kind="foreign", __str__=lambda: "foreign on near")
    part = LinkPart(cast(Any, choice), lambda closers: LinkContext(cast(Any, None), cast(Any, closers)), Parts())
    part.open()
    assert part.record() == {"name": "foreign on far", **made[0].said}
    part.close()
