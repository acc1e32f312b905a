"""Plug-ins of another package that are wrong: each is told by name, and takes nothing from what omote has itself."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS
from controller.takes.reader import TAKES, load_take, reader_of
from controller.tools.plugins import EXPORTERS, REGISTRIES, ListedPlugin, added_exporters, list_plugins
from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.errors import PluginError
from drivers.core.registry import FAMILIES
from drivers.sim.wire.simulator import simulator_of

SPEC = ServoSpec(1, "jaw", "rc-180", -0.5, 0.5, 5.0, 50.0)
FAMILY = """
from drivers.core.families import AnySettings, Family
PLUGIN = Family(
    api=1, kind="{kind}", title="trial", driver="drivers.ssc32.bus:Ssc32Bus", settings=AnySettings,
    check_model="drivers.boards.hobby:check_hobby", simulator="{simulator}",
)
NOTHING = 3
"""
TAKE = """
from controller.takes.reader import TakeReader
PLUGIN = TakeReader(api=1, kind="{kind}", title="trial", suffixes=("{suffix}",), read="plugin_{kind}:read")
def read(path, parameters):
    return None
"""
EXPORTER = """
from surface.export.exporter import Exporter
PLUGIN = Exporter(api=1, kind="{kind}", title="trial", suffixes=("{suffix}",), write=lambda head, path, pose: [path])
"""

Install = Callable[[str, str, str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Adds one plug-in of a foreign package: its group, its kind and its module's text."""
    monkeypatch.syspath_prepend(tmp_path)

    def add(group: str, kind: str, text: str) -> None:
        info = tmp_path / f"{kind}_package-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {kind}-package\nVersion: 1\n")
        (info / "entry_points.txt").write_text(f"[omote.{group}]\n{kind} = plugin_{kind}:PLUGIN\n")
        (tmp_path / f"plugin_{kind}.py").write_text(text)

    yield add
    for name in [name for name in sys.modules if name.startswith("plugin_")]:
        del sys.modules[name]
    for registry in REGISTRIES.values():
        registry.clear()


def test_a_take_that_is_none_is_told(install: Install, tmp_path: Path) -> None:
    install("takes", "empty", TAKE.format(kind="empty", suffix=".empty"))
    with pytest.raises(TakeError, match="take kind 'empty' gave no take, but None"):
        load_take(tmp_path / "a.empty", PARAMETERS)


@pytest.mark.parametrize("suffix", [".csv", "track", ".TRACK"])
def test_a_reader_takes_no_suffix_of_ours_and_none_that_is_no_suffix(
    install: Install, suffix: str, tmp_path: Path
) -> None:
    install("takes", "aaa", TAKE.format(kind="aaa", suffix=suffix))
    with pytest.raises(PluginError, match="aaa-package cannot be used"):
        TAKES.get("aaa")
    (tmp_path / "face.csv").write_text("Timecode,BlendShapeCount,JawOpen")
    assert reader_of(tmp_path / "face.csv").kind == "livelink"


def test_an_exporter_takes_no_suffix_of_ours(install: Install) -> None:
    install("exporters", "aaa", EXPORTER.format(kind="aaa", suffix=".glb"))
    with pytest.raises(PluginError, match=r"\.glb is written by the built-in kind 'glb'"):
        EXPORTERS.get("aaa")
    assert [one.kind for one in EXPORTERS.all()] == ["glb", "obj", "urdf"]


def test_added_exporters_are_those_of_other_packages_one_a_suffix(install: Install) -> None:
    assert added_exporters() == []
    for kind, suffix in (("aaa", ".one"), ("bbb", ".one"), ("ccc", ".two")):
        install("exporters", kind, EXPORTER.format(kind=kind, suffix=suffix))
    assert [one.kind for one in added_exporters()] == ["aaa", "ccc"]


def test_a_family_without_a_simulator_is_driven_but_not_stood_in_for(install: Install) -> None:
    install("drivers", "bare", FAMILY.format(kind="bare", simulator=""))
    assert open_bus("bare", [SPEC], port="/dev/null").ids == (1,)
    for ask in (lambda: simulator_of("bare"), lambda: open_bus("simulated", [SPEC], simulates="bare")):
        with pytest.raises(PluginError, match="bus kind 'bare' has no simulator"):
            ask()


def test_a_simulator_must_be_one(install: Install) -> None:
    install("drivers", "odd", FAMILY.format(kind="odd", simulator="plugin_odd:NOTHING"))
    assert FAMILIES.get("odd").kind == "odd"
    with pytest.raises(PluginError, match="plugin_odd:NOTHING, which is no Simulator"):
        simulator_of("odd")


def test_what_cannot_be_used_is_listed_with_the_reason_and_the_rest_as_ever(install: Install) -> None:
    before = {(each.registry, each.kind) for each in list_plugins()}
    install("drivers", "wrong", "PLUGIN = 3\n")
    found = {(each.registry, each.kind): each for each in list_plugins()}
    assert set(found) == before | {("bus", "wrong")}
    wrong = found["bus", "wrong"]
    assert "wrong-package must be a Family, not 3" in wrong.fault and wrong.hint
    assert not any(found[key].fault for key in before)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(ListedPlugin).anything = 1


def test_a_kind_that_omote_has_itself_is_listed_as_never_used(install: Install) -> None:
    install("drivers", "dynamixel", FAMILY.format(kind="dynamixel", simulator=""))
    own, foreign = (each for each in list_plugins() if (each.registry, each.kind) == ("bus", "dynamixel"))
    assert not own.fault and own.package == "omote"
    assert foreign.fault and foreign.package == "dynamixel-package"
    assert "is never used" in foreign.fault and foreign.hint.startswith("pip uninstall dynamixel-package")
