"""Heads of surfaces: their own control points in the head's frame, closed directions and trims kept, eyes found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from cards import card
from relief import ball, cube_tsm, named, relief, tube

from surface import Domain
from surface.base.errors import FitError, HeadFileError, SurfaceFileError
from surface.export import export_head
from surface.fit.surfaces import SurfaceOptions, fit_surfaces, head_of
from surface.fit.surfaces.report import SurfaceReport
from surface.head import Group, Head, HeadData
from surface.head.model.accessories import read_accessories, write_accessories
from surface.head.model.file import load_data
from surface.head.posing.part import HeadPart
from surface.readers import NamedSurface, write_surfaces

MM = SurfaceOptions(unit="mm", up="y", forward="z")
LOOP = [(0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9)]


def write(folder: Path, items: list[NamedSurface]) -> Path:
    write_surfaces(folder / "face.json", items)
    return folder / "face.json"


def test_control_points_are_the_files_own(tmp_path: Path) -> None:
    sheet = relief()
    trimmed = NamedSurface("sheet", sheet, Domain((0, 1, 0, 1), [LOOP]))
    report = fit_surfaces(write(tmp_path, [trimmed]), tmp_path / "h", name="h", options=MM, report_dir=tmp_path / "r")
    (part,) = Head.load(tmp_path / "h").data.parts
    placement = Head.load(tmp_path / "h").data.placement
    np.testing.assert_allclose(placement.file_points(part.points), sheet.points, atol=1e-9)
    np.testing.assert_array_equal(part.weights, sheet.weights)
    np.testing.assert_array_equal(part.loops[0], LOOP)
    assert part.rect == (0, 1, 0, 1) and not part.flip and part.name == "face"
    assert report.parts[0].title == "sheet" and report.parts[0].deviation_mm == 0.0
    assert json.loads((tmp_path / "r" / "report.json").read_text())["parts"][0]["points"] == sheet.n
    assert "no groups" in (tmp_path / "r" / "report.md").read_text()


def test_axes_and_unit_as_told() -> None:
    data = head_of(named(face=relief()), name="h", options=SurfaceOptions(unit="cm", up="-x", forward="z"))
    assert data.placement.scale == 10.0
    np.testing.assert_allclose(data.placement.turn @ [-1, 0, 0], [0, 1, 0])
    at = data.parts[0].points
    np.testing.assert_allclose(at.min(axis=0) + at.max(axis=0), 0.0, atol=120.0)  # in the middle, by its samples


@pytest.mark.slow
def test_a_closed_direction_stays_closed(tmp_path: Path) -> None:
    fit_surfaces(write(tmp_path, named(tube=tube(60, 200))), tmp_path / "h", name="h", options=MM)
    head = Head.load(tmp_path / "h")
    assert head.data.parts[0].closed_u == (0.0, 12.0) and head.data.parts[0].closed_v is None
    assert head.parts[0].stored
    heights = np.unique(np.round(head.parts[0].vertices[np.unique(head.parts[0].borders)][:, 1], 3))
    assert len(heights) == 2  # borders above and below only, no seam
    assert "format = 2" in (tmp_path / "h" / "head.toml").read_text()
    head.pose(head.values({"headYaw": 0.5}))
    assert np.isfinite(head.parts[0].vertices).all()


@pytest.mark.parametrize("turned", [False, True])
def test_the_outside_is_what_is_seen(turned: bool) -> None:
    data = head_of(named(face=relief(turned=turned)), name="h", options=MM)
    assert data.parts[0].flip is turned
    assert (Head(data).parts[0].normals[:, 2] > 0).all()


@pytest.mark.slow
def test_two_balls_are_eyes_that_turn() -> None:
    items = named(
        ball_b=ball((-30, 30, 40), 12), skin=relief(), ball_a=ball((30, 30, 40), 12), knob=ball((0, 90, 0), 5)
    )
    data = head_of(items, name="h", options=MM)
    follows = {p.name: p.follows for p in data.parts}
    assert follows == {"face": "skin", "ball_b": "right_eye", "ball_a": "left_eye", "knob": "skin"}
    assert data.eye_radius == pytest.approx(12, abs=0.05)
    np.testing.assert_allclose(data.eyes[0] - data.eyes[1], [60, 0, 0], atol=0.1)
    head = Head(data)
    before = head.part("ball_a").vertices.copy()
    head.pose(head.values({"leftEyeYaw": 1.0}))
    assert np.linalg.norm(head.part("ball_a").vertices - before, axis=1).max() > 1.0


def crack(part: HeadPart) -> tuple[float, float]:
    """Of a part of a closed form: how far edges with one triangle lie from the next such edge, at most, and the angle
    between the normals there, in degrees. Edges whose ends lie at the same places are joined."""
    places, normals = part.vertices.astype(float), part.normals.astype(float)
    _, back = np.unique(np.round(places / 1e-4), axis=0, return_inverse=True)
    own = part.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ends = np.sort(back.ravel()[own], axis=1)
    _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    own = own[(count[edge.ravel()] == 1) & (ends[:, 0] != ends[:, 1])]
    a, along = places[own[:, 0]], places[own[:, 1]] - places[own[:, 0]]
    gap = angle = 0.0
    for k in range(len(own)):
        middle = a[k] + 0.5 * along[k]
        t = np.clip(((middle - a) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        away = np.linalg.norm(a + t[:, None] * along - middle, axis=1)
        away[k] = np.inf
        near = int(away.argmin())
        one, two = normals[own[k]].sum(axis=0), (1 - t[near]) * normals[own[near, 0]] + t[near] * normals[own[near, 1]]
        cosine = one @ two / np.linalg.norm(one) / np.linalg.norm(two)
        gap, angle = max(gap, away[near]), max(angle, float(np.degrees(np.arccos(min(cosine, 1.0)))))
    return gap, angle


STAR_GROUP = """
[[groups]]
name = "mouthSmileLeft"
at = [50, 60, 50]
radius = 70
move = [9, 9, 0]
"""


@pytest.fixture(scope="module")
def starred(tmp_path_factory: pytest.TempPathFactory) -> tuple[HeadData, SurfaceReport]:
    """A head of a closed T-spline with star points, with a group, and its report."""
    folder = tmp_path_factory.mktemp("starred")
    (folder / "cube.tsm").write_text(cube_tsm(3))
    (folder / "g.toml").write_text(STAR_GROUP)
    options = replace(MM, groups=(folder / "g.toml",))
    report = fit_surfaces(folder / "cube.tsm", folder / "h", name="h", options=options)
    return load_data(folder / "h"), report


@pytest.mark.slow
def test_a_spline_with_star_points_is_told_as_fitted_and_sewn_in_every_pose(starred) -> None:
    data, report = starred
    assert 0 < report.parts[0].deviation_mm < 0.5
    assert "exact, except near star points:" in report.lines()[0]
    face, bend = data.parts[0], np.array([[0.2, 0.1, 0.0], [-0.3, 0.1, 0.2], [0.0, 0.4, -0.2]])
    moves = (face.points @ bend).astype(np.float32)  # linear, so that charts still meet
    group = Group("jawOpen", np.arange(len(moves), dtype=np.int32), moves)
    head, size = Head(replace(data, parts=[replace(face, groups=[group])])), float(np.ptp(face.points, axis=0).max())
    for amount in (0.0, 1.0):
        head.pose(head.values({"jawOpen": amount}))
        gap, angle = crack(head.part("face"))
        assert gap < 0.02 + 1e-5 * size and angle < 0.5  # seams overlap by 0.02 mm
    assert len(data.seams) > 50 and crack(Head(replace(data, seams=[])).part("face"))[0] > 1e-4 * size


@pytest.mark.slow
def test_charts_of_a_spline_with_star_points_move_as_one(starred) -> None:
    """By a group of a file: points of several charts in one place, which are regular there, move alike."""
    part = starred[0].parts[0]
    shift = np.zeros_like(part.points)
    shift[part.groups[0].ids] = part.groups[0].moves
    _, first, same = np.unique(np.round(part.points, 6), axis=0, return_index=True, return_inverse=True)
    regular = np.bincount(same.ravel())[same.ravel()] > 1
    np.testing.assert_allclose(shift[regular], shift[first[same.ravel()]][regular], atol=1e-5)
    assert np.abs(shift).max() > 3


def test_a_head_without_eyes_and_groups_runs_and_is_exported(tmp_path: Path) -> None:
    head = Head(head_of(named(face=relief()), name="h", options=MM))
    head.pose(head.values({"jawOpen": 1.0, "headPitch": 0.3}))
    (written, *_) = export_head(head, tmp_path / "h.glb", {}, [], "file")
    assert written.stat().st_size > 1000


@pytest.mark.slow
def test_names_choose_surfaces(tmp_path: Path) -> None:
    path = write(tmp_path, named(face=relief(), hat=tube(90, 30), other=tube(50, 30)))
    report = fit_surfaces(path, tmp_path / "h", name="h", options=MM)
    assert [row.title for row in report.parts] == ["face", "other"]
    assert any("'hat'" in line and "--only" in line for line in report.lines())
    kept = fit_surfaces(path, tmp_path / "h", name="h", options=SurfaceOptions(unit="mm", only=("hat", "fac")))
    assert {row.title for row in kept.parts} == {"face", "hat"}
    less = fit_surfaces(path, tmp_path / "h", name="h", options=SurfaceOptions(unit="mm", without=("OTHER",)))
    assert [row.title for row in less.parts] == ["face"]
    for bad, why in (
        (SurfaceOptions(only=("nose",)), "--only nose"),
        (SurfaceOptions(without=("face", "hat", "other")), "nothing is left"),
    ):
        with pytest.raises(FitError, match=why):
            fit_surfaces(path, tmp_path / "none", name="h", options=bad)
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_equal_names_are_told_apart() -> None:
    items = [NamedSurface("a/b", relief()), *named(face=tube(20, 20)), NamedSurface("a/b", tube(30, 20))]
    assert [p.name for p in head_of(items, name="h", options=MM).parts] == ["face", "face 2", "a b 2"]


def test_what_is_no_head_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FitError, match="holds no surface"):
        head_of([], name="h")
    outside = NamedSurface("far", relief(), Domain((0, 1, 0, 1), [[(2, 2), (3, 2), (3, 3)]]))
    with pytest.raises(FitError, match="'far' covers nothing"):
        head_of([outside], name="h")
    huge = relief().with_points(relief().points * 1e9)
    with pytest.raises(FitError, match="no head does"):
        head_of(named(face=huge), name="h")
    (tmp_path / "a.xml").write_text("<xml></xml>")
    with pytest.raises(SurfaceFileError, match="holds no surface"):
        fit_surfaces(tmp_path / "a.xml", tmp_path / "h", name="h")


def test_the_python_of_the_docs_runs(tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (root / "docs" / "surface.md").read_text(encoding="utf-8")
    code = page.partition("### In Python")[2].partition("```python\n")[2].partition("```")[0]
    write(tmp_path, named(face=relief()))
    (tmp_path / "heads").mkdir()
    monkeypatch.chdir(tmp_path)
    exec(code, {})  # the page's own example
    head = Head.load(tmp_path / "heads" / "face")
    before = head.parts[0].vertices.copy()
    head.pose(head.values({"mouthSmileLeft": 1.0}))
    assert (head.parts[0].vertices - before)[:, 1].max() == pytest.approx(5.0, abs=0.01)


def test_the_group_file_of_the_docs_is_read(tmp_path: Path, root: Path) -> None:
    page = (root / "docs" / "surface.md").read_text(encoding="utf-8")
    (tmp_path / "g.toml").write_text(
        page.partition("### Groups by hand")[2].partition("```toml\n")[2].partition("```")[0]
    )
    options = SurfaceOptions(unit="mm", up="y", forward="z", groups=(tmp_path / "g.toml",))
    groups = head_of(
        named(face=relief().with_points(relief().points + np.array([0, 0, 60]))), name="h", options=options
    )
    assert {g.name for g in groups.parts[0].groups} == {"mouthSmileLeft", "mouthSmileRight", "jawOpen"}


def test_a_head_that_cannot_be_replaced_keeps_its_hair_and_one_that_is_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, place = write(tmp_path, named(tube=tube(60, 200))), tmp_path / "h"
    fit_surfaces(path, place, name="h", options=MM)
    write_accessories(place, [card()])
    with monkeypatch.context() as patch:
        patch.setattr("surface.fit.measures.saving.save_data", Mock(side_effect=HeadFileError("full")))
        with pytest.raises(HeadFileError, match="full"):
            fit_surfaces(path, place, name="h", options=MM)
    assert len(read_accessories(place)) == 1
    fit_surfaces(path, place, name="h", options=MM)
    assert {file.name for file in place.iterdir()} == {"head.toml", "head.npz"}
