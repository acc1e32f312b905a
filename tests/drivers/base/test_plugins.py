"""drivers.base.plugins: built-in and foreign plug-ins are found, and one that is wrong breaks nothing but itself."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from drivers.base.errors import PluginError
from drivers.base.plugins import Registry, folders_with, modules_in

GROUP = "omote.trials"


@dataclass(frozen=True, kw_only=True)
class Trial:
    api: int
    kind: str
    work: str = "json:dumps"
    install: str = ""
    words: tuple[str, ...] = ()
    count: int = 0


HEAD = "from tests.drivers.base.test_plugins import Trial\n"
GOOD = HEAD + "THING = Trial(api=1, kind='good', words=('a', 'b'), count=3)\n"

Install = Callable[..., Registry[Trial]]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a package with entry points where packages are found; gives a registry that looks for them."""
    monkeypatch.syspath_prepend(tmp_path)
    for name in [name for name in sys.modules if name.startswith("trial_")]:
        monkeypatch.delitem(sys.modules, name)
    registry = Registry(Trial, "trial", GROUP, 1, lambda: {"own": "trial_own"}, "THING", reserved=["other"])
    (tmp_path / "trial_own.py").write_text(HEAD + "THING = Trial(api=1, kind='own')\n")

    def add(**modules: str) -> Registry[Trial]:
        info = tmp_path / "somebody-0.3.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: somebody\nVersion: 0.3\n")
        entries = "".join(f"{kind} = trial_of_{kind}:THING\n" for kind in modules)
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{entries}")
        for kind, text in modules.items():
            (tmp_path / f"trial_of_{kind}.py").write_text(text)
        return registry

    return add


def test_built_in_and_foreign_ones_stand_side_by_side(install: Install) -> None:
    registry = install(good=GOOD)
    assert registry.kinds() == ["good", "own"]
    assert [plugin.kind for plugin in registry.all()] == ["own", "good"]  # the built-in ones first
    assert (registry.package_of("good"), registry.package_of("own")) == ("somebody 0.3", "")
    assert registry.load(registry.get("good"), "json:dumps")([1]) == "[1]"


def test_a_built_in_kind_cannot_be_replaced(install: Install) -> None:
    registry = install(own="raise SystemExit('this is not to be imported')")
    assert registry.get("own").kind == "own"
    assert registry.package_of("own") == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + "THING = Trial(api=0, kind='bad')", "made for version 0 of omote.trials; this omote has version 1"),
        (HEAD + "THING = Trial(api=1, kind='worse')", "says that its kind is 'worse'"),
        (HEAD + "THING = Trial(api=1, kind='bad', work=3)", "work must be str, not 3"),
        (HEAD + "THING = Trial(api=1, kind='bad', words=['a'])", "words must be a tuple of texts, not ['a']"),
        (HEAD + "THING = Trial(api=1, kind='bad', words=('a', 1))", "words must be a tuple of texts, not ('a', 1)"),
        (HEAD + "THING = Trial(api=1, kind='bad', count='3')", "count must be int, not '3'"),
        (HEAD + "THING = Trial(api=1, kind='bad', colour='red')", "TypeError"),
        ("THING = 3", "must be a Trial, not 3"),
        ("THING = 1 / 0", "ZeroDivisionError"),
        ("import no_such_package", "No module named 'no_such_package'"),
        ("", "has no attribute 'THING'"),
        ("THING = (", "SyntaxError"),
        ("raise SystemExit(3)", "SystemExit: 3"),
    ],
)
def test_one_that_is_wrong_is_told_and_left_out(
    install: Install, text: str, message: str, caplog: pytest.LogCaptureFixture
) -> None:
    registry = install(bad=text, good=GOOD)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            assert [plugin.kind for plugin in registry.all()] == ["own", "good"]
    assert len(caplog.records) == 1  # once, however often it is looked for
    with pytest.raises(PluginError) as caught:
        registry.get("bad")
    assert message in str(caught.value) and "somebody" in str(caught.value)
    assert caught.value.hint.startswith("pip install --upgrade somebody")


def test_one_made_for_a_newer_omote_asks_for_that(install: Install) -> None:
    with pytest.raises(PluginError, match="made for version 2") as caught:
        install(bad=HEAD + "THING = Trial(api=2, kind='bad')").get("bad")
    assert caught.value.hint == "pip install --upgrade omote"


def test_a_kind_in_two_packages_is_refused_by_both_names(install: Install, tmp_path: Path) -> None:
    registry = install(good=GOOD)
    another = tmp_path / "another-1.dist-info"
    another.mkdir()
    (another / "METADATA").write_text("Metadata-Version: 2.1\nName: another\nVersion: 1\n")
    (another / "entry_points.txt").write_text(f"[{GROUP}]\ngood = trial_of_good:THING\nother = trial_of_good:THING\n")
    with pytest.raises(PluginError, match="in more than one package: another, somebody"):
        registry.get("good")
    assert [*registry.shadowed()] == [("other", "another")]
    with pytest.raises(PluginError, match="unknown trial 'other'"):
        registry.get("other")


def test_a_damaged_list_of_entry_points_takes_nothing_from_others(install: Install, tmp_path: Path) -> None:
    registry = install(good=GOOD)
    broken = tmp_path / "broken-1.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1\n")
    (broken / "entry_points.txt").write_text(f"[{GROUP}]\nno equals sign\n")
    assert registry.kinds() == ["good", "own"]


def test_an_error_of_another_package_names_it_and_ours_goes_through(install: Install) -> None:
    registry = install(good=GOOD)
    with (
        pytest.raises(PluginError, match=r"of the package somebody 0\.3 failed: KeyError"),
        registry.naming_package("good"),
    ):
        raise KeyError("x")
    for kind, error in (("own", KeyError("x")), ("good", ValueError("x")), ("good", PluginError("x"))):
        with pytest.raises(type(error)) as caught, registry.naming_package(kind):
            raise error
        assert caught.value is error


def test_an_unknown_kind_names_the_known_ones(install: Install) -> None:
    with pytest.raises(PluginError, match="unknown trial 'god', did you mean 'good'") as caught:
        install(good=GOOD).get("god")
    assert caught.value.hint == "use one of: good, own"


@pytest.mark.parametrize(
    ("plugin", "reference", "message", "hint"),
    [
        (Trial(api=1, kind="x"), "no_vendor.deep:thing", "needs the package 'no_vendor'", "pip install no_vendor"),
        (Trial(api=1, kind="x", install="omote[can]"), "no_vendor:thing", "needs the pack", 'pip install "omote[can]"'),
        (Trial(api=1, kind="x"), "json:nothing", "names json:nothing", "update the package"),
        (Trial(api=1, kind="x"), "json.nowhere:thing", "there is no module json.nowhere", "update the package"),
        (Trial(api=1, kind="x"), "tests.drivers.base.no:x", "there is no module tests.drivers.base.no", "update"),
    ],
)  # fmt: skip
def test_what_cannot_be_loaded_is_told_with_what_to_install(
    install: Install, plugin: Trial, reference: str, message: str, hint: str
) -> None:
    with pytest.raises(PluginError) as caught:
        install().load(plugin, reference)
    assert message in str(caught.value)
    assert caught.value.hint.startswith(hint)


def test_a_plug_in_that_is_installed_later_is_found_after_a_new_look(install: Install) -> None:
    registry = install(late="THING = None")
    with pytest.raises(PluginError):
        registry.get("late")
    registry.clear()
    assert registry.kinds() == ["late", "own"]


def test_folders_and_modules_are_what_is_there() -> None:
    assert folders_with("drivers", "family")["maestro"] == "drivers.maestro.family"
    assert "core" not in folders_with("drivers", "family")
    assert modules_in("controller.takes.readers")["wav"] == "controller.takes.readers.wav"
