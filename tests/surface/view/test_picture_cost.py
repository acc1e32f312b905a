"""benchmarks/picture_cost.py, with few frames of few pixels: it runs to its end."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_every_row_is_measured_and_pixels_are_counted(
    benchmark: Callable[[str], ModuleType], quality: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    program = benchmark("picture_cost")
    monkeypatch.setattr(program, "FRAMES", 1)
    program.main(["--quality", quality, "--size", "96x54", "--person", "maple"])
    shown = capsys.readouterr().out
    assert "drawing without strand" in shown and "posing, every parameter" in shown
    assert int(shown.partition(" pixels of ")[0].split()[-1]) > 500
