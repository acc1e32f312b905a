"""controller.panels.web_face: the panel's face is made beside a run and ends with it."""

from __future__ import annotations

import gzip
import time
from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.panels.web_face import face_file_in_background, make_face
from surface.head.model.file import save_data
from tests.surface.small_head import part, small_head

WAIT_S = 120.0


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """A stage whose face is one small patch."""
    save_data(tmp_path / "small", small_head(parts=[part("face", -40)], seams=[], paint=[]))
    path = tmp_path / "stage.toml"
    path.write_text('name = "small"\nhead = "small"\n')
    return path


def test_a_face_is_a_packed_glb(stage: Path, tmp_path: Path) -> None:
    make_face(str(stage), {}, {}, tmp_path / "face.glb.gz")
    assert gzip.decompress((tmp_path / "face.glb.gz").read_bytes())[:4] == b"glTF"


def test_a_stage_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nowhere"):
        make_face(str(tmp_path / "nowhere.toml"), {}, {}, tmp_path / "face.glb.gz")


def test_it_has_the_control_points_of_a_vocabulary_that_a_run_was_given(stage: Path, tmp_path: Path) -> None:
    (tmp_path / "ear.json").write_text('{"format": 1, "part": "face", "ids": [12], "moves_mm": [[0, 3, 0]]}')
    words = '[parameters.earLeft]\nregion = "mouth"\nprofile = "mouth"\ngroup = "ear.json"\n'
    (tmp_path / "ears.toml").write_text(words)
    make_face(str(stage), {}, {}, tmp_path / "face.glb.gz", [tmp_path / "ears.toml"])
    assert b'"earLeft"' in gzip.decompress((tmp_path / "face.glb.gz").read_bytes())
    make_face(str(stage), {}, {}, tmp_path / "face.glb.gz")
    assert b'"earLeft"' not in gzip.decompress((tmp_path / "face.glb.gz").read_bytes())


@pytest.mark.slow
def test_it_appears_while_the_context_lasts_and_leaves_nothing(stage: Path) -> None:
    with face_file_in_background(stage, {}, None) as path:
        end = time.monotonic() + WAIT_S
        while not path.exists() and time.monotonic() < end:
            time.sleep(0.05)
        assert gzip.decompress(path.read_bytes())[:4] == b"glTF"
    assert not path.parent.exists()


def test_a_run_that_ends_early_ends_it(stage: Path) -> None:
    with face_file_in_background(stage, {}, None) as path:
        pass
    assert not path.parent.exists()
