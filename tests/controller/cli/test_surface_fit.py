"""``omote fit`` of surface files as a user types it: options, table, notes; what belongs to meshes is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError
from controller.base.paths import find_config
from controller.cli.app import make_app
from surface.fit.surfaces import SurfaceOptions, SurfaceReport, SurfaceRow


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple]:
    """What the making of heads was given, in place of it."""
    made: list[tuple] = []

    def fit_surfaces(path, out, *, name, options, progress, report_dir):
        made.append((path, out, name, options, report_dir))
        progress("placing", 0.5)
        rows = [SurfaceRow("face", "object 3", "skin", "skin", 77), SurfaceRow("b", "b", "skin", "skin", 5, 0.25)]
        return SurfaceReport(name, rows, ["jawOpen"], ["cheekPuff"], ["a note [x]"])

    monkeypatch.setattr("surface.fit.surfaces.fit_surfaces", fit_surfaces)
    monkeypatch.setattr("surface.view.draw.decimate.decimate_head", lambda out: None)
    monkeypatch.setattr("surface.view.draw.grain.grain_head", lambda out: None)
    monkeypatch.setattr("surface.view.pictures.occlusion.shade_head", lambda out: None)
    return made


def fit(*words: str):
    return CliRunner().invoke(make_app(), ["fit", *words])


def test_options_are_passed_on_and_all_is_told(calls: list[tuple], tmp_path: Path) -> None:
    out = tmp_path / "mine"
    said = fit("a.3DM", "-o", str(out))
    assert said.exit_code == 0, said.output
    assert calls == [(Path("a.3DM"), out, "mine", SurfaceOptions(), None)]
    words = " ".join(said.output.replace("│", " ").replace("┃", " ").split())
    assert "mine: 82 control points, 1 shapes" in words and "face object 3 skin skin 77" in words
    assert "b: exact, except near star points: 0.250 mm or less" in words and "a note [x]" in words
    assert "no group for cheekPuff: these parameters will not move this head" in words
    more = ["--name", "you", "--unit", "cm", "--up", "z", "--forward", "-y", "--without", "x", "--only", "a", "--only"]
    more += ["b", "--groups", "g.toml", "--strict", "--expressions-from", "ict", "--landmarks", "l.toml"]
    assert fit("a.tsm", "-o", str(out), *more, "--report", "r").exit_code == 0
    ict = find_config("heads", "ict")
    wanted = SurfaceOptions("cm", "z", "-y", ("x",), ("a", "b"), True, (Path("g.toml"),), ict, Path("l.toml"))
    assert calls[1] == (Path("a.tsm"), out, "you", wanted, Path("r"))


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["a.xml", "--shapes", "s"], "--shapes: is for meshes"),
        (["a.json", "--names", "n.toml"], "--names: is for meshes"),
        (["a.json", "--keep"], "--keep: is for meshes"),
        (["a.json", "--identities", "i.npz"], "--identities: is for meshes"),
        (["a.tsm", "--landmarks", "l.toml"], "--landmarks: only a transfer"),
        (["a.glb", "--only", "x"], "--only: is for files of surfaces"),
        (["a.glb", "--groups", "g.toml"], "--groups: is for files of surfaces"),
        (["a.glb", "--strict"], "--strict: is for files of surfaces"),
        (["a.tsm", "--expressions-from", "nobody"], "nobody"),
    ],
)
def test_options_that_do_not_fit_are_refused(calls: list[tuple], tmp_path: Path, words: list[str], why: str) -> None:
    said = fit(*words, "-o", str(tmp_path / "h"))
    assert isinstance(said.exception, ConfigError) and why in str(said.exception) and said.exception.hint
    assert calls == [] and not (tmp_path / "h").exists()
