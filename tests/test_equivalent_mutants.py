"""tests/equivalent_mutants.txt lists only lines that are in the code: others would mislead readers."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_ENTRY = re.compile(r"(\S+): (.*?)  ->  (.*)  # (\S.*)")


def _without_spaces(text: str) -> str:
    return re.sub(r"\s+", "", text)


def test_every_entry_names_a_line_of_code_another_one_and_a_reason() -> None:
    stale = []
    for line in (ROOT / "tests/equivalent_mutants.txt").read_text().splitlines():
        entry = _ENTRY.fullmatch(line)
        assert entry is not None, line
        module, original, changed, _ = entry.groups()
        path = ROOT / module
        if (
            original == changed
            or not path.is_file()
            or _without_spaces(original) not in _without_spaces(path.read_text())
        ):
            stale.append(line)
    assert stale == []
