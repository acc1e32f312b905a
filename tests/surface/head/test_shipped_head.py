"""configs/heads/ict: the files beside the head were made from the head as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.fit.points.report import RMS_MM
from surface.head import Head
from surface.head.model.sidecar import read_sidecar
from surface.head.posing.baked import LEVELS, checksums, read_shade
from surface.head.posing.fit_error import FIT_ERROR, read_fit_error
from surface.view.draw import materials


@pytest.fixture(scope="module")
def folder(root: Path) -> Path:
    return root / "configs" / "heads" / "ict"


@pytest.fixture(scope="module")
def head(folder: Path) -> Head:
    return Head.load(folder)


def test_every_part_has_its_baked_shade(head: Head, folder: Path) -> None:
    shares = read_shade(folder, head.parts)
    sizes = {part.name: len(part.vertices) for part in head.parts}
    assert {name: len(share) for name, share in shares.items() if "/" not in name} == sizes
    assert all(len(share) == sizes[name.split("/")[0]] for name, share in shares.items())
    skins = {part.name for part in head.parts if materials.material_of(part.material).program == "skin"}
    assert skins <= {name.split("/")[0] for name in shares if name.endswith("/visible")}


@pytest.mark.parametrize("file", ["occlusion.npz", "decimated.npz"])
def test_files_beside_it_say_which_tessellation_they_are_for(head: Head, folder: Path, file: str) -> None:
    assert read_sidecar(folder / file, lambda kept: kept.checks, "") == checksums(head.parts)


def test_it_knows_how_far_it_is_from_the_mesh_that_it_was_fitted_to(head: Head, folder: Path) -> None:
    found = read_fit_error(folder, head.parts)
    checks = read_sidecar(folder / FIT_ERROR, lambda kept: kept.checks, "")
    assert found.keys() == checks.keys() and checks.items() <= checksums(head.parts).items()
    face = head.part("face").attributes["fit_error"]
    assert len(face) == len(head.part("face").vertices) and face.max() < 3.0
    assert np.sqrt(np.mean(face**2)) < RMS_MM


def test_every_part_has_its_lean_triangles(head: Head) -> None:
    for part in head.parts:
        assert part.decimated.keys() == set(LEVELS), part.name
        assert len(part.triangles) > len(part.decimated["full"]) >= len(part.decimated["fast"]), part.name


def test_the_grain_of_its_skin_is_laid_out_for_its_meshes(head: Head, folder: Path) -> None:
    skins = {part.name for part in head.parts if part.material == "skin"}
    checks = read_sidecar(folder / "grain.npz", lambda kept: kept.checks, "")
    assert checks.keys() == skins and checks.items() <= checksums(head.parts).items()
    assert all(head.part(name).attributes["grain"].shape == (len(head.part(name).vertices), 2) for name in skins)
