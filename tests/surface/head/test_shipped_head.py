"""configs/heads/ict: the files beside the head were made from the head as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from surface.head import Head
from surface.head.model.sidecar import read_sidecar
from surface.head.posing.baked import LEVELS, checksums, read_shade
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


def test_every_part_has_its_lean_triangles(head: Head) -> None:
    for part in head.parts:
        assert part.decimated.keys() == set(LEVELS), part.name
        assert len(part.triangles) > len(part.decimated["full"]) >= len(part.decimated["fast"]), part.name
