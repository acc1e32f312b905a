"""A part fails alone: one message, growing pauses, switched off in the end."""

from __future__ import annotations

import itertools

import pytest

from controller.base.errors import ConfigError
from controller.base.parts import PAUSES_S, RESET_AFTER_S, Part, Parts, describe


def broken() -> None:
    raise ZeroDivisionError("division by zero")


def test_a_failure_is_said_once_with_what_why_and_how_it_comes_back(caplog: pytest.LogCaptureFixture) -> None:
    ended: list[int] = []
    part = Part("gaze", effect="its layer fades out", ended=lambda: ended.append(1))
    part.run(broken, 100.0)
    assert caplog.messages == [
        "gaze failed: ZeroDivisionError: division by zero; its layer fades out; it starts again in 1 s"
    ]
    assert part.failed and not part.off and ended == [1]
    part.run(lambda: pytest.fail("its pause is not over"), 100.9)
    part.run(lambda: None, 101.0)
    assert not part.failed and caplog.messages[1:] == ["gaze works again"]
    part.run(lambda: None, 101.1)
    assert len(caplog.messages) == 2


def test_pauses_grow_until_it_is_switched_off(caplog: pytest.LogCaptureFixture) -> None:
    part, now, pauses = Part("idle motion"), 100.0, []
    for _ in range(10_000):
        failures = part.failures
        part.run(broken, now)
        if part.failures > failures:
            pauses.append(now)
        now += 0.5
    assert [b - a for a, b in itertools.pairwise(pauses)] == list(PAUSES_S) == [1.0, 2.0, 4.0, 8.0, 16.0]
    assert part.off and len(caplog.messages) == 2  # the first failure, and that it is off
    assert caplog.messages[1] == (
        "idle motion failed 6 times in a row and is switched off: ZeroDivisionError: division by zero; "
        "it comes back with the next start"
    )
    assert part.report() == {
        "part": "idle motion",
        "failures": 6,
        "why": "ZeroDivisionError: division by zero",
        "state": "switched off",
    }


def test_a_failure_after_a_calm_time_counts_as_the_first() -> None:
    part = Part("voice")
    assert [part.fail(OSError(), i * (RESET_AFTER_S + 1.0)) for i in range(20)] == [PAUSES_S[0]] * 20
    keen = Part("link", keep_trying=True)
    pauses = [keen.fail(OSError(), i * 16.0) for i in range(9)]
    assert pauses == [*PAUSES_S, *[PAUSES_S[-1]] * 4] and not keen.off


def test_a_part_with_a_remedy_waits_for_nobody(caplog: pytest.LogCaptureFixture) -> None:
    part = Part("show tour", remedy="SHOW tour begins it again")
    part.run(broken, 5.0)
    assert caplog.messages == ["show tour failed: ZeroDivisionError: division by zero; SHOW tour begins it again"]
    part.run(lambda: None, 5.0)
    assert not part.failed


def test_what_fails_while_it_ends_changes_nothing(caplog: pytest.LogCaptureFixture) -> None:
    part = Part("take", ended=broken)
    part.run(broken, 1.0)
    assert part.failures == 1 and "could not be ended in order" in caplog.messages[1]


def test_every_part_has_one_name() -> None:
    parts = Parts()
    first = parts.add(Part("gaze"))
    assert parts.add(Part("gaze")) is first and parts.failed == () and parts.report() == []
    first.fail(ValueError("no"), 1.0)
    assert parts.failed == ("gaze",)
    first.recover()
    assert parts.failed == () and parts.report()[0]["state"] == "at work"


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ConfigError("a.toml: wrong", hint="mend it"), "a.toml: wrong (mend it)"),
        (ConfigError("a.toml: wrong"), "a.toml: wrong"),
        (OSError(28, "No space left on device", "/a/b.rec"), "/a/b.rec: No space left on device"),
        (OSError(5, "Input/output error"), "Input/output error"),
        (OSError("odd"), "OSError: odd"),
        (KeyError("x"), "KeyError: 'x'"),
    ],
)
def test_an_error_is_described_for_people(error: Exception, text: str) -> None:
    assert describe(error) == text
