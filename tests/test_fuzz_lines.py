"""The fuzzer of the line protocol: a short run finds nothing, and it would find what it looks for."""

from __future__ import annotations

from collections import Counter

import pytest

from controller.base.parameters import PARAMETERS
from controller.links.line.commands import COMMANDS, Grammar
from controller.links.line.protocol import MAX_LINE, LineError
from controller.vocabulary.vocabulary import Vocabulary
from tests.fuzz.line_corpus import Lines
from tests.fuzz.lines import Findings, attack


@pytest.mark.slow
def test_a_short_run_finds_no_fault() -> None:
    found = attack(1500, seed=7)
    assert found.faults == Counter() and found.lines >= 1500 and found.probes > 50
    links = found.report["links"]
    assert isinstance(links, list) and links[0]["accepted"] > 300 and len(links[0]["refused"]) >= 8
    assert "faults: none" in str(found)


def test_lines_are_of_every_command_and_of_every_sort() -> None:
    vocabulary = Vocabulary.load(PARAMETERS)
    grammar = Grammar(PARAMETERS, lambda name: vocabulary[name].name)
    lines, accepted = Lines(3), Counter[str]()
    for _ in range(3000):
        try:
            request = grammar.parse(lines.right())
        except LineError:
            continue
        accepted[request.command.name.split()[0] if request else ""] += 1
    assert {*accepted} == {*COMMANDS} - {"FRAME", "VERSION"}  # FRAME becomes SET, and VERSION becomes HELLO
    drawn = [lines.any() for _ in range(1000)]
    assert all(line.endswith((b"\n", b"\r")) for line in drawn)
    assert {line.split()[0] for _ in range(20) for line in lines.flood()} >= {b"NEUTRAL", b"EXPR", b"SHOW"}
    assert max(map(len, drawn)) > MAX_LINE and any(line[0] >= 0x80 for line in drawn)


def test_what_must_not_be_is_named() -> None:
    found = Findings(faults=Counter({"hangs": 1}))
    assert "'hangs': 1" in str(found)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_seed_draws_the_same_lines(seed: int) -> None:
    one, two = Lines(seed), Lines(seed)
    assert [one.any() for _ in range(50)] == [two.any() for _ in range(50)]
