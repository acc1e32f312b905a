"""surface.export.exporter: what an exporter must say of itself, and that the shipped ones do."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from pathlib import Path

import pytest

from surface.export import glb, obj
from surface.export.exporter import API, Exporter

SHIPPED = [glb.EXPORTER, obj.EXPORTER]
OPTIONAL = {"install": "", "write_in_file": None, "animate": None, "write_web": None}


def write(head: object, path: Path, pose: object) -> list[Path]:
    """Writes nothing."""
    return []


def test_the_least_that_an_exporter_says() -> None:
    made = Exporter(api=API, kind="x", title="x", suffixes=(".x",), write=write)
    assert API == 1
    assert {name: getattr(made, name) for name in OPTIONAL} == OPTIONAL
    needed = {field.name for field in dataclasses.fields(Exporter) if field.default is dataclasses.MISSING}
    assert needed == {"api", "kind", "title", "suffixes", "write"}
    with pytest.raises(TypeError, match="positional"):
        Exporter(1, "x", "x", (".x",), write)  # type: ignore[misc]
    with pytest.raises(TypeError, match="write"):
        Exporter(api=1, kind="x", title="x", suffixes=(".x",))  # type: ignore[call-arg]


def test_what_an_exporter_says_does_not_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        glb.EXPORTER.kind = "other"  # type: ignore[misc]


@pytest.mark.parametrize("exporter", SHIPPED, ids=lambda each: each.kind)
def test_shipped_exporters_take_what_is_given_to_them(exporter: Exporter) -> None:
    """Words of a call: head, path, pose; with an animation before the path."""
    assert exporter.api == API and exporter.title and inspect.getmodule(exporter.write) is not None
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in exporter.suffixes)
    calls: list[tuple[Callable[..., object] | None, int]] = [
        (exporter.write, 3), (exporter.write_in_file, 3), (exporter.animate, 4), (exporter.write_web, 3),
    ]  # fmt: skip
    for call, words in calls:
        if call is not None:
            inspect.signature(call).bind(*range(words))
            with pytest.raises(TypeError):
                inspect.signature(call).bind(*range(words - 1))


def test_suffixes_and_kinds_are_those_of_one_exporter() -> None:
    suffixes = [suffix for exporter in SHIPPED for suffix in exporter.suffixes]
    assert len(set(suffixes)) == len(suffixes) and {each.kind for each in SHIPPED} == {"glb", "obj"}
