"""Every example of docs/line-protocol.md, sent to a real session: it answers what the page says."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line.commands import COMMANDS, Grammar
from controller.links.line.protocol import parse_reply
from controller.links.line.session import LineSession

PAGE = Path(__file__).resolve().parent.parent / "docs" / "line-protocol.md"
TEXT = PAGE.read_text(encoding="utf-8")
FENCED = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
BLOCKS = [text.splitlines() for language, text in FENCED if not language]
TALKS = [block for block in BLOCKS if block[0].startswith("> ")]
LINES = [block for block in BLOCKS if block[0].split()[0].partition("*")[0] in COMMANDS]
MS, TICK_MS = 1_000_000, 10
NUMBER = r"-?\d+(\.\d+)?"


class Talk:
    """A session of its own, with a clock that goes to the times of the page's streamed lines."""

    def __init__(self) -> None:
        self.state = CommandState(P)
        self.session = LineSession(self.state, 0, name="line /dev/ttyUSB0", checksum="latched")
        self.now_ms = 0

    def advance(self, to_ms: int) -> None:
        out = P.neutral()
        while self.now_ms < to_ms:
            self.now_ms += TICK_MS
            self.state.tick(self.now_ms * MS, TICK_MS / 1000, out)

    def say(self, line: str) -> list[str]:
        return self.session.feed(line.encode() + b"\n", self.now_ms * MS).decode().splitlines()

    def streamed(self) -> str:
        return self.session.stream(self.now_ms * MS).decode().strip()


def expected(line: str) -> str:
    """The page's line as a pattern: ``...`` stands for anything, and streamed values and the version may differ."""
    head = re.fullmatch(r"([PF] \d+)(.*)", line)
    if head:
        line = head[1] + re.sub(r"(?<=[ =])-?\d+(\.\d+)?(?= |$)", "NUMBER", head[2])
    pattern = re.escape(re.sub(r"omote \S+", "omote VERSION", line))
    return pattern.replace(r"\.\.\.", ".*").replace("VERSION", r"\S+").replace("NUMBER", NUMBER)


def test_the_page_has_examples() -> None:
    assert len(TALKS) >= 7 and len(LINES) >= 1


@pytest.mark.parametrize("block", TALKS, ids=lambda block: block[0][2:30])
def test_an_example_is_answered_as_the_page_says(block: list[str]) -> None:
    talk, answers = Talk(), list[str]()
    for n, line in enumerate(block):
        sign, _, text = line.partition(" ")
        if sign == ">":
            assert not answers, f"the page leaves out {answers}"
            if n + 2 < len(block) and (later := re.match(r"< [PF] (\d+)", block[n + 2])):
                talk.advance(int(later[1]))
            answers = talk.say(text)
        elif found := re.match(r"[PF] (\d+)", text):
            talk.advance(int(found[1]))
            assert re.fullmatch(expected(text), said := talk.streamed()), said
        else:
            assert answers and re.fullmatch(expected(text), answers[0]), answers
            answers = answers[1:]
    assert not answers


@pytest.mark.parametrize("line", [line for block in LINES for line in block])
def test_a_line_that_the_page_shows_is_accepted(line: str) -> None:
    (answer,) = Talk().say(line)
    reply = parse_reply(answer.encode())
    assert reply is not None and reply.ok and reply.checked


def commands_in_the_text() -> Iterator[str]:
    """Whole commands in backticks that name no placeholder."""
    text = re.sub(r"^```.*?^```", "", TEXT, flags=re.MULTILINE | re.DOTALL)
    for found in re.findall(r"`([A-Z]+ [^`]*)`", text):
        if found.split()[0] in {*COMMANDS} - {"SHOW"} and not PLACEHOLDER.search(found):
            yield found


PLACEHOLDER = re.compile(r"\.\.\.|[][*=]|\b(name|value|v0|rate_hz|what|yaw|x|amount|mark|word)\b|^READ$|^SET$")


@pytest.mark.parametrize("line", sorted(set(commands_in_the_text())))
def test_a_command_in_the_text_is_one(line: str) -> None:
    state = CommandState(P)
    assert Grammar(P, lambda name: state.vocabulary[name].name).parse(line.encode()) is not None
