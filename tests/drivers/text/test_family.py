"""drivers.text.family: options of a text board are checked before any port is opened."""

from __future__ import annotations

import pytest

from drivers.base.options import check_options, entries
from drivers.core.families import RESERVED
from drivers.core.registry import FAMILIES
from drivers.text.family import FAMILY, TextSettings
from drivers.text.template import TEXTS


def test_every_text_is_an_option() -> None:
    assert {*TEXTS} < {entry.name for entry in entries(TextSettings)}
    check_options(TextSettings, RESERVED)


def test_the_definition_leads_to_its_driver_and_simulator() -> None:
    assert FAMILIES.get("text") is FAMILY
    assert FAMILIES.load(FAMILY, FAMILY.driver).__name__ == "TextBus"
    assert FAMILIES.load(FAMILY, FAMILY.simulator).options
    assert FAMILY.hobby


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ({}, "template is missing"),
        ({"off": "D{ch}\n"}, "template is missing"),
        ({"template": "S{ch}\n"}, r"holds no value \(put one of \{us\}"),
        ({"template": "{uss}"}, r"unknown placeholder \{uss\}.*\(placeholders are"),
        ({"template": "{us}\n", "query": "?"}, "query and answer go together"),
        ({"template": "{us}\n", "separator": "{ch}"}, r"separator: unknown placeholder"),
    ],
)
def test_texts_that_do_not_fit_are_refused_with_what_to_write(texts: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TextSettings(**texts).check(50.0)


def test_texts_that_fit_pass() -> None:
    TextSettings(template="#{ch}P{us}").check(50.0)
    TextSettings(template="#{ch}P{us}", end="\r", off="x{ch}", query="?{ch}\n", answer="{ch}={us}\n").check(50.0)
