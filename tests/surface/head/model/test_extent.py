"""Parts that are closed, flipped, cut or have a rectangle: they come back, state their version, and are checked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_head import part, small_head

from surface.base.errors import HeadFileError
from surface.head import Head, HeadData
from surface.head.model.file import load_data, save_data
from surface.head.model.meshes import make_surface, pack, tessellate, unpack
from surface.mesh.domain import Slit

CUTS = (Slit("u", 0.5, 0.25, 0.75), Slit("v", 0.25, 0.0, 0.5))


def head(**fields: object) -> HeadData:
    """One patch, with some fields changed."""
    return small_head(parts=[replace(part("a", 0), **fields)], seams=[], paint=[])


def test_all_of_it_comes_back(tmp_path: Path) -> None:
    fields = {
        "closed_u": (0.0, 1.0),
        "closed_v": (-1.0, 2.0),
        "rect": (0.0, 1.0, 0.25, 1.0),
        "flip": True,
        "cuts": CUTS,
    }
    save_data(tmp_path, head(loops=[], **fields))
    (got,) = load_data(tmp_path).parts
    assert {key: getattr(got, key) for key in fields} == fields and got.loops == []
    assert (tmp_path / "head.toml").read_text().startswith("format = 2\n")


def test_other_heads_stay_in_the_older_format(tmp_path: Path) -> None:
    save_data(tmp_path, head())
    assert (tmp_path / "head.toml").read_text().startswith("format = 1\n")
    (got,) = load_data(tmp_path).parts
    assert (got.closed_u, got.closed_v, got.rect, got.flip, got.cuts) == (None, None, None, False, ())


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("closed_u = [\n    0.0,\n    1.0,\n]", "closed_u = [1, 1]", r"parts\[0\]\.closed_u: \[1\.0, 1\.0\] does not"),
        ("flip = true", "flip = 1", r"parts\[0\]\.flip: 1 is neither true nor false"),
        ("rect = [\n    0.0,", "rect = [\n    2.0,", r"parts\[0\]\.rect: .* does not rise"),
    ],
)  # fmt: skip
def test_damage_names_the_key(tmp_path: Path, old: str, new: str, why: str) -> None:
    save_data(tmp_path, head(closed_u=(0.0, 1.0), rect=(0.0, 1.0, 0.0, 1.0), flip=True))
    text = (tmp_path / "head.toml").read_text()
    assert old in text
    (tmp_path / "head.toml").write_text(text.replace(old, new))
    with pytest.raises(HeadFileError, match=why):
        load_data(tmp_path)


def test_a_cut_that_is_none_is_refused(tmp_path: Path) -> None:
    save_data(tmp_path, head(cuts=CUTS))
    with np.load(tmp_path / "head.npz") as stored:
        arrays = dict(stored)
    np.savez(tmp_path / "head.npz", **{**arrays, "a/cuts": np.array([[0, 0.5, 0.75, 0.25]])})
    with pytest.raises(HeadFileError, match=r"a/cuts: holds what is no cut"):
        load_data(tmp_path)


def test_a_flipped_part_shows_its_other_side() -> None:
    one, other = (Head(head(flip=flip)).parts[0] for flip in (False, True))
    np.testing.assert_allclose(one.normals[:5], -other.normals[:5], atol=1e-6)
    assert {tuple(sorted(t)) for t in one.triangles.tolist()} == {tuple(sorted(t)) for t in other.triangles.tolist()}


def test_a_stored_mesh_of_the_other_side_is_made_again() -> None:
    data = head().parts[0]
    surface = make_surface(data)
    stored = pack(tessellate(data, surface), data.budget)
    assert unpack(stored, surface, data.budget, rough=True) is not None
    assert unpack(stored, surface, data.budget, rough=True, flip=True) is None


def test_cuts_open_the_mesh() -> None:
    data = head(cuts=CUTS[:1]).parts[0]
    mesh = tessellate(data, make_surface(data))
    on = (mesh.uv[:, 1] == 0.5) & (mesh.uv[:, 0] > 0.25) & (mesh.uv[:, 0] < 0.75)
    assert on.sum() == 2 * len(np.unique(mesh.uv[on], axis=0)) > 0


def test_without_loops_and_rectangle_nothing_is_drawn() -> None:
    with pytest.raises(HeadFileError, match="neither loops nor rect"):
        Head(head(loops=[]))
