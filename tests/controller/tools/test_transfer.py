"""Options of a transfer of expressions."""

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.tools import transfer as module
from controller.tools.transfer import Source, check_transfer, transfer
from surface.base.errors import FitError
from surface.base.progress import no_progress
from surface.fit.source.load import LoadOptions

NONE = {"--identities": None, "--keep": False}


def test_options_that_go_together_pass():
    check_transfer(None, None, NONE | {"--identities": Path("i.npz")})
    check_transfer("ict", Path("marks.toml"), NONE)


@pytest.mark.parametrize(
    ("source", "landmarks", "others", "message"),
    [
        (None, Path("marks.toml"), NONE, "--landmarks: only"),
        ("ict", None, NONE | {"--identities": Path("i.npz")}, "--identities: cannot be used with --expressions-from"),
        ("ict", None, NONE | {"--keep": True}, "--keep: cannot"),
    ],
)
def test_options_that_do_not_are_refused(source, landmarks, others, message):
    with pytest.raises(ConfigError, match=message):
        check_transfer(source, landmarks, others)


def test_a_head_that_is_not_there_and_a_scan_that_is_not(tmp_path):
    with pytest.raises(ConfigError, match=r"itc.*did you mean 'ict'"):
        transfer(tmp_path / "a.ply", Source("itc"), tmp_path / "head", "x", LoadOptions(), no_progress)
    with pytest.raises(FitError, match="no such"):
        transfer(tmp_path / "a.ply", Source("ict"), tmp_path / "head", "x", LoadOptions(), no_progress)


def test_own_shapes_can_only_be_left_out_where_a_head_gives_others():
    check_transfer("ict", None, NONE, own_shapes=False)
    with pytest.raises(ConfigError, match="--no-own-shapes: no head"):
        check_transfer(None, None, NONE, own_shapes=False)


@pytest.fixture
def called(monkeypatch):
    """Which of the two ways a mesh went: kept shapes filled in, or all of them transferred."""
    out = []
    monkeypatch.setattr(module, "shapes_in", lambda mesh, _: ("jawOpen",) if mesh.suffix == ".glb" else ())
    monkeypatch.setattr(module, "fit_head", lambda *_, filling, **more: out.append(("filled", filling.landmarks)))
    monkeypatch.setattr(module, "transfer_head", lambda *_, landmarks, **more: out.append(("all", landmarks)) or FIT)
    return out


FIT = type("Made", (), {"fit": None})


@pytest.mark.parametrize(
    ("mesh", "own", "way"), [("a.glb", True, "filled"), ("a.glb", False, "all"), ("a.obj", True, "all")]
)
def test_a_mesh_with_shapes_keeps_them_unless_told_otherwise(called, tmp_path, mesh, own, way):
    source = Source("ict", tmp_path / "marks.toml", own)
    transfer(tmp_path / mesh, source, tmp_path / "head", "x", LoadOptions(), no_progress)
    assert called == [(way, tmp_path / "marks.toml")]


def test_names_of_shapes_that_are_not_there_or_not_taken_are_refused(called, tmp_path):
    options = LoadOptions(names=tmp_path / "names.toml")
    transfer(tmp_path / "a.glb", Source("ict"), tmp_path / "head", "x", options, no_progress)
    with pytest.raises(ConfigError, match="--names: all shapes come from ict"):
        transfer(tmp_path / "a.obj", Source("ict"), tmp_path / "head", "x", options, no_progress)
