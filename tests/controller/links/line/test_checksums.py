"""When a line must have a checksum."""

from __future__ import annotations

import pytest

from controller.base.errors import ParameterError
from controller.links.line.checksums import CHECKSUMS, ChecksumRule
from controller.links.line.protocol import Code, LineError, Words

PLAIN, CHECKED = Words(("PING",), 7), Words(("PING",), 7, True)


def refused(rule: ChecksumRule, words: Words = PLAIN) -> bool:
    try:
        rule.check(words)
    except LineError as error:
        assert (error.code, error.tag) == (Code.CHECKSUM, None)
        return True
    return False


@pytest.mark.parametrize(("mode", "before", "after"), [("optional", 0, 0), ("latched", 0, 1), ("required", 1, 1)])
def test_lines_without_one_are_refused(mode: str, before: bool, after: bool) -> None:
    rule = ChecksumRule(mode)
    assert refused(rule) == before
    assert not refused(rule, CHECKED)
    assert refused(rule) == after and not refused(rule, CHECKED)


@pytest.mark.parametrize("first", CHECKSUMS[:2])
@pytest.mark.parametrize("then", CHECKSUMS)
def test_the_other_end_may_change_what_the_stage_leaves_open(first: str, then: str) -> None:
    rule = ChecksumRule(first)
    rule.check(CHECKED)
    assert not refused(rule, Words(("hello", f"Checksum={then}"), 7))
    rule.change(then, checked=False)
    assert rule.mode == then and refused(rule) == (then == "required")
    rule.change(then, checked=True)
    assert refused(rule) == (then != "optional")


def test_what_the_stage_requires_stays() -> None:
    rule = ChecksumRule("required")
    assert refused(rule, Words(("HELLO", "checksum=optional"), 7))
    with pytest.raises(ParameterError, match="the stage's file requires checksums"):
        rule.change("latched", checked=True)
    rule.change("required", checked=True)
    assert refused(rule)


@pytest.mark.parametrize(
    "words", [("HELLO",), ("HELLO", "x"), ("PING", "checksum=latched"), ("HELLO", "checksum=a", "b")]
)
def test_only_the_request_for_another_mode_is_taken_without_one(words: tuple[str, ...]) -> None:
    rule = ChecksumRule("latched")
    rule.check(CHECKED)
    assert refused(rule, Words(words, 7))
