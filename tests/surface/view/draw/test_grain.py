"""Grain of skin: as large on every part of a face, and read back as it was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.base.errors import HeadFileError
from surface.head import Head, load_data
from surface.head.posing.baked import read_grain, write_grain
from surface.head.posing.part import HeadPart
from surface.view.draw.grain import even_grain
from surface.view.draw.materials import DETAIL_TILE_MM, detail_uv, wrapped_uv
from surface.view.scene.theme import THEMES

SHIPPED = Path(__file__).parents[4] / "configs" / "heads" / "ict"


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(load_data(SHIPPED), "shipped")


def stretches(part: HeadPart, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return by triangle of a part, as it is posed: tiles a tile's length on skin along the longest and the shortest
    way, and its area, mm^2; worked out from lengths in space alone."""
    a, b, c = part.vertices.astype(float)[part.triangles].transpose(1, 0, 2)
    e, f = b - a, c - a
    metric = np.stack([np.einsum("ij,ij->i", p, q) for p, q in ((e, e), (e, f), (f, e), (f, f))], 1).reshape(-1, 2, 2)
    on = uv.astype(float)[part.triangles]
    sides = DETAIL_TILE_MM * np.stack([on[:, 1] - on[:, 0], on[:, 2] - on[:, 0]], 1)
    area = 0.5 * np.sqrt(np.maximum(np.linalg.det(metric), 0.0))
    good = area > 1e-3
    squares = np.linalg.eigvals(np.linalg.solve(metric[good], sides[good] @ sides[good].transpose(0, 2, 1))).real
    lengths = np.sqrt(np.sort(np.maximum(squares, 0.0), axis=1))
    return lengths[:, 1], lengths[:, 0], area[good]


def share_stretched(part: HeadPart, uv: np.ndarray, times: float = 1.6) -> float:
    """Return the share of a part's skin where the grain is that much longer one way than the other."""
    long, short, area = stretches(part, uv)
    return float(area[long > times * short].sum() / area.sum())


def test_grain_is_hardly_stretched_where_longitude_and_latitude_stretch_it(head: Head) -> None:
    laid, face = even_grain(head), head.part("face")
    assert share_stretched(face, wrapped_uv(face)) > 0.3
    assert share_stretched(face, laid["face"]) < 0.03
    assert share_stretched(head.part("back"), laid["back"]) < 0.03
    long, short, area = stretches(face, laid["face"])
    assert area[(long * short > 0.5) & (long * short < 2.0)].sum() > 0.9 * area.sum()


def test_grain_of_lids_follows_them_when_they_open_wide(head: Head) -> None:
    laid, face = even_grain(head)["face"], head.part("face")
    start = wrapped_uv(face)
    eye = head.part("eye_left").vertices.mean(axis=0)
    off = face.vertices[face.triangles].mean(axis=1) - eye
    lid = (np.abs(off[:, 0]) < 14) & (off[:, 1] > 2) & (off[:, 1] < 14) & (off[:, 2] > 4)
    whole, face.triangles = face.triangles, face.triangles[lid]
    head.pose(head.values({"eyeWideLeft": 1, "browInnerUp": 1, "browOuterUpLeft": 1}))
    try:
        assert share_stretched(face, laid, 2.0) < 0.5 * share_stretched(face, start, 2.0)
    finally:
        face.triangles = whole
        head.pose(np.zeros(len(head.parameters)))


def test_grain_is_read_as_it_was_written_and_plates_do_without(head: Head, tmp_path: Path) -> None:
    part = head.part("face")
    laid = np.random.default_rng(1).uniform(-9.0, 9.0, (len(part.vertices), 2))
    write_grain(tmp_path, {"face": laid}, head.parts)
    found = read_grain(tmp_path, head.parts)
    np.testing.assert_allclose(found["face"], laid, atol=1e-3)
    part.attributes["grain"] = found["face"]
    try:
        np.testing.assert_array_equal(detail_uv(part, THEMES["skin"]), found["face"])
        for theme in ("mask", "robot"):
            np.testing.assert_array_equal(detail_uv(part, THEMES[theme]), wrapped_uv(part))
    finally:
        del part.attributes["grain"]


def test_damaged_grain_is_reported(head: Head, tmp_path: Path) -> None:
    np.savez(tmp_path / "grain.npz", face=np.zeros((3, 2), np.float32))
    with pytest.raises(HeadFileError, match="int16"):
        read_grain(tmp_path, head.parts)
