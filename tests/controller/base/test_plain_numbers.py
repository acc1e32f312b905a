"""Numbers as lines, scripts and formulas write them."""

from __future__ import annotations

import pytest

from controller.base.plain_numbers import plain_number


@pytest.mark.parametrize(
    ("text", "value"),
    [("0", 0.0), ("-0.5", -0.5), ("+1.", 1.0), (".8", 0.8), ("1e-3", 1e-3), ("2E2", 200.0), ("007", 7.0)],
)
def test_plain_decimals_are_numbers(text: str, value: float) -> None:
    assert plain_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        "",
        ".",
        "1_0",
        "nan",
        "inf",
        "-inf",
        "1e999",
        "1e1000",
        "0x1",
        "0,5",
        " 1",
        "1\n",
        "--1",
        "1e",
        "\u0661",
        "\uff11",
    ],
)
def test_other_texts_are_none(text: str) -> None:
    assert plain_number(text) is None
