"""surface.head.posing.fit_error: distances from the mesh survive their file, and belong to one order of vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_head import save_small_head

from surface.base.errors import HeadFileError
from surface.head import Head, save_data
from surface.head.model.light import LightPoints
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.model.sidecar import write_sidecar
from surface.head.posing.fit_error import FIT_ERROR, read_fit_error, write_fit_error


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return save_small_head(tmp_path)


def errors(head: Head) -> np.ndarray:
    """(m,) mm of part a: 0 to 3, the last one not measured."""
    return np.append(np.linspace(0.0, 3.0, len(head.part("a").vertices) - 1), np.nan)


def test_distances_survive_the_file_to_a_hundredth_and_the_head_has_them(folder: Path) -> None:
    head = Head.load(folder)
    assert "fit_error" not in head.part("a").attributes
    wanted = errors(head)
    assert write_fit_error(folder, {"a": wanted}, head.parts) == folder / FIT_ERROR
    again = Head.load(folder)
    np.testing.assert_allclose(again.part("a").attributes["fit_error"], wanted, atol=0.0051)
    assert "fit_error" not in again.part("b").attributes


def test_the_greatest_distance_is_not_taken_for_an_unknown_one(folder: Path) -> None:
    head = Head.load(folder)
    far = np.full(len(head.part("a").vertices), 1e6)
    write_fit_error(folder, {"a": far}, head.parts)
    assert (read_fit_error(folder)["a"] > 600.0).all()


def test_a_file_for_another_mesh_is_refused_with_what_to_do(folder: Path) -> None:
    head = Head.load(folder)
    write_fit_error(folder, {"a": errors(head)}, head.parts)
    first, *others = head.data.parts
    finer = replace(first, budget=(0, 0.01, 6))
    finer = replace(finer, mesh=pack(tessellate(finer, make_surface(finer), head.data.seams), finer.budget))
    save_data(folder, replace(head.data, parts=[finer, *others]))
    with pytest.raises(HeadFileError, match="another mesh of part 'a'") as caught:
        Head.load(folder)
    assert "delete" in caught.value.hint


@pytest.mark.parametrize("array", [np.zeros((3, 2), np.uint16), np.zeros(3), np.zeros((), np.uint16)])
def test_what_is_no_array_of_distances_is_named(folder: Path, array: np.ndarray) -> None:
    write_sidecar(folder / FIT_ERROR, {"a": array})
    with pytest.raises(HeadFileError, match=FIT_ERROR):
        Head.load(folder)


def test_vertices_that_added_points_bring_have_distances_between_those_about_them(folder: Path) -> None:
    head = Head.load(folder)
    wanted = np.linspace(1.0, 2.0, len(head.part("a").vertices))
    write_fit_error(folder, {"a": wanted}, head.parts)
    knots = np.linspace(0.4, 0.6, 5)[None]
    finer = Head.load(folder, light=[LightPoints("a", knots, knots)]).part("a")
    assert len(finer.attributes["fit_error"]) == len(finer.vertices) > len(wanted)
    assert finer.attributes["fit_error"].min() >= 0.995 and finer.attributes["fit_error"].max() <= 2.005
