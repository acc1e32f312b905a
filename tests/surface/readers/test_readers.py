"""Whatever is done to a file, readers give surfaces or one ``SurfaceFileError``."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from surface import SurfaceFileError
from surface.readers import read_surface, summary
from tests.surface.readers import test_gismo, test_plain, test_tsm

GOOD = {
    ".tsm": test_tsm.GOOD,
    ".xml": test_gismo.THB,
    ".json": json.dumps(test_plain.good(), indent=1),
}
WORDS = ["-1", "0", "3", "1.5", "nan", "inf", "1e308", "-1e308", "1e-320", "9" * 20, "", "x", '"', "<", "{", "null"]


@st.composite
def damaged(draw: st.DrawFn, text: str) -> str:
    """The text with words replaced, and lines dropped or doubled."""
    for _ in range(draw(st.integers(1, 3))):
        words = list(re.finditer(r"[-\w.]+", text))
        lines = text.split("\n")
        kind, place = draw(st.integers(0, 4)), draw(st.integers(0, 10_000))
        if kind < 3 and words:
            word = words[place % len(words)]
            text = text[: word.start()] + draw(st.sampled_from(WORDS)) + text[word.end() :]
        else:
            at = place % len(lines)
            text = "\n".join(lines[:at] + lines[at : at + 1] * (2 * (kind == 3)) + lines[at + 1 :])
    return text


@pytest.mark.slow
@pytest.mark.parametrize("suffix", GOOD)
@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damage_is_never_another_error(tmp_path: Path, suffix: str, data: st.DataObject) -> None:
    file = tmp_path / f"a{suffix}"
    file.write_text(data.draw(damaged(GOOD[suffix])))
    try:
        items = read_surface(file)
    except SurfaceFileError as error:
        assert str(file) in str(error)
        assert error.hint
    else:
        assert all(summary(item) for item in items)


def test_the_undamaged_files_are_read(tmp_path: Path) -> None:
    for suffix, text in GOOD.items():
        file = tmp_path / f"a{suffix}"
        file.write_text(text)
        assert read_surface(file)[0].surface.n > 0
