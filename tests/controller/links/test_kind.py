"""Kinds of links: the built-in one, and definitions that are refused."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS
from controller.formats.format import FORMATS
from controller.layers.commands import CommandState
from controller.links.kind import API, LINKS, LinkContext, LinkKind
from drivers.base.errors import PluginError

MODULE = """
from dataclasses import dataclass
from controller.links.kind import LinkKind
from drivers.base.options import option

@dataclass(frozen=True, kw_only=True)
class Settings:
    {field}: int = option("Where.", 5)

PLUGIN = LinkKind(api={api}, kind="{kind}", title="trial", settings=Settings, open="plugin_{kind}:start")
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Adds a kind of link of another package."""
    monkeypatch.syspath_prepend(tmp_path)

    def add(kind: str, *, api: int = API, field: str = "port") -> None:
        info = tmp_path / f"{kind}_package-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {kind}-package\nVersion: 1\n")
        (info / "entry_points.txt").write_text(f"[omote.links]\n{kind} = plugin_{kind}:PLUGIN\n")
        (tmp_path / f"plugin_{kind}.py").write_text(MODULE.format(kind=kind, api=api, field=field))

    yield add
    for name in [name for name in sys.modules if name.startswith("plugin_")]:
        del sys.modules[name]
    LINKS.clear()


def test_built_in_kinds_are_folders_and_formats() -> None:
    assert LINKS.kinds() == sorted(["line", "ros2", "web", "websocket", *FORMATS.kinds()])
    line = LINKS.get("line")
    assert isinstance(line, LinkKind) and line.api == API and line.install == "pyserial"
    assert callable(LINKS.load(line, line.open))


def test_a_kind_of_another_package_is_found(install: Callable[..., None]) -> None:
    install("udp")
    assert LINKS.get("udp").settings().port == 5
    assert [kind.kind for kind in LINKS.all()] == [
        *sorted(["line", "ros2", "web", "websocket", *FORMATS.kinds()]),
        "udp",
    ]
    assert LINKS.get("udp").install == ""


def test_a_kind_for_another_version_is_refused(install: Callable[..., None]) -> None:
    install("late", api=API + 1)
    with pytest.raises(PluginError, match="late-package"):
        LINKS.get("late")


def test_an_option_called_like_a_key_of_every_link_is_refused(install: Callable[..., None]) -> None:
    install("odd", field="kind")
    with pytest.raises(PluginError, match="odd-package"):
        LINKS.get("odd")


def test_a_context_has_no_further_files_unless_a_stage_names_them() -> None:
    state = CommandState(PARAMETERS)
    with ExitStack() as closers:
        context = LinkContext(state, closers)
        assert (context.sink, context.closers, context.vocabularies, context.beside) == (state, closers, (), None)
        with pytest.raises(FrozenInstanceError):
            context.beside = Path()  # type: ignore[misc]


def test_records_cannot_be_changed() -> None:
    for record in (LinkContext, LinkKind):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1
