"""surface.head.posing.shade"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ball_head import skin

from surface.base.errors import HeadFileError
from surface.head.posing.shade import FILE, apply_shade, read_shade, write_shade


def test_shares_survive_the_file(tmp_path: Path) -> None:
    share = np.linspace(0, 1, 30)[:, None]
    path = write_shade(tmp_path, {"face": share, "back": np.ones((4, 1))})
    assert path == tmp_path / FILE
    back = read_shade(tmp_path / "head.toml")
    assert back["face"] == pytest.approx(share, abs=0.5 / 255 + 1e-6)
    assert (back["back"] == 1.0).all()
    assert [entry.name for entry in tmp_path.iterdir()] == [FILE]


def test_a_head_without_shade(tmp_path: Path) -> None:
    assert read_shade(tmp_path) == {}


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    write_shade(tmp_path, {"face": np.ones((300, 1))})
    whole = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(HeadFileError, match=FILE) as caught:
        read_shade(tmp_path)
    assert "delete" in caught.value.hint


def test_shade_darkens_what_is_painted_and_passes_over_another_mesh() -> None:
    part = skin()
    count = len(part.rest)
    apply_shade([part], {"face": np.full((count, 1), 0.5, np.float32), "gone": np.ones((3, 1), np.float32)})
    apply_shade([part], {"face": np.full((count, 1), 0.5, np.float32)})
    assert part.attributes["occlusion"] == pytest.approx(np.full((count, 1), 0.25))
    apply_shade([part], {"face": np.zeros((count - 1, 1), np.float32)})
    assert part.attributes["occlusion"].min() == pytest.approx(0.25)


def test_shade_stops_at_a_painted_floor() -> None:
    part = skin()
    part.attributes["occlusion_floor"] = np.full((len(part.rest), 1), 0.4, np.float32)
    apply_shade([part], {"face": np.linspace(0.0, 1.0, len(part.rest), dtype=np.float32)[:, None]})
    assert part.attributes["occlusion"].min() == pytest.approx(0.4)
    assert part.attributes["occlusion"].max() == pytest.approx(1.0)
