"""From a file with a few shapes of its own to a head that has all of them and passes every check."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fewer_points import fewer_points
from part_mesh import ICT, part_mesh, shipped

from surface.check.checker import check_head
from surface.check.lids import eye_opening
from surface.check.subject import Subject
from surface.fit.api import fit_head
from surface.fit.filling.api import Filling
from surface.fit.points.report import FitReport
from surface.fit.source.mesh import FitMesh
from surface.head import Head

OWN = ("jawOpen", "mouthSmileLeft", "mouthSmileRight")
KEPT = ("face", "eye_left", "eye_right", "tongue")  # teeth and lashes would take most of the time
HALF = 0.5  # of the shipped head's smiles: so the mesh's own can be told from them
FEWER = {"FEATURES": 300, "FACE": 150, "REST": 110}  # of the registration: the mesh differs smoothly from the head


def other_face(p: np.ndarray) -> np.ndarray:
    """A wider, shorter face with a longer chin."""
    out = p * [1.04, 0.98, 1.0]
    out[:, 1] -= 4.0 * np.exp(-((p[:, 0] / 30) ** 2) - ((p[:, 1] + 75) / 25) ** 2)
    return out


def write_obj(path: Path, mesh: FitMesh) -> None:
    """The mesh with the names of its pieces, in mm, and its shapes beside it."""
    lines = []
    for k, name in enumerate(mesh.pieces):
        title, material = name.split("/")
        lines += [f"o {title}", f"usemtl {material}"]
        lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces[mesh.piece == k, :3] + 1]
    shapes = path.with_name(f"{path.stem}_shapes")
    shapes.mkdir()
    named = {path: 0.0} | {shapes / f"{n}.obj": d for n, d in zip(mesh.names, mesh.deltas, strict=True)}
    for file, delta in named.items():
        points = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in mesh.vertices + delta]
        file.write_text("\n".join(points + lines * (file == path)) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def trap(tmp_path_factory: pytest.TempPathFactory) -> tuple[FitMesh, Path]:
    mesh, ids = part_mesh(OWN, off=np.zeros(3))
    kept = np.sort(np.concatenate([ids[name] for name in KEPT]))
    chosen = np.isin(mesh.faces[:, 0], kept)
    faces = np.where(mesh.faces < 0, -1, np.searchsorted(kept, mesh.faces))[chosen]
    mesh = replace(
        mesh, vertices=mesh.vertices[kept], faces=faces, deltas=mesh.deltas[:, kept], piece=mesh.piece[chosen]
    )
    share = np.array([1.0, HALF, HALF])[:, None, None]
    deltas = np.stack([other_face(mesh.vertices + d) - other_face(mesh.vertices) for d in mesh.deltas])
    mesh = replace(mesh, vertices=other_face(mesh.vertices), deltas=share * deltas)
    path = tmp_path_factory.mktemp("fill") / "me.obj"
    write_obj(path, mesh)
    return mesh, path


@pytest.fixture(scope="module")
def filled(trap) -> tuple[Head, FitReport, Path]:
    path = trap[1]
    with pytest.MonkeyPatch.context() as patch, fewer_points(1500):
        for name, count in FEWER.items():
            patch.setattr(f"surface.fit.transfer.register.{name}", count)
        out, told = path.parent / "head", path.parent / "report"
        report = fit_head(path, out, name="me", report_dir=told, filling=Filling(ICT))
    return Head.load(out), report, told


@pytest.mark.slow
def test_a_file_that_lacks_shapes_becomes_a_head_with_all_of_them_that_is_good(filled) -> None:
    head, report, _ = filled
    assert check_head(head) == [] and report.faults == ()
    assert set(report.parameters) == set(shipped().head.groups) and not report.missing


@pytest.mark.slow
def test_the_report_says_which_shapes_came_from_where(filled) -> None:
    _, _, told = filled
    table = json.loads((told / "report.json").read_text())
    assert not set(OWN) & set(table["filled"]) and {"eyeBlinkLeft", "cheekPuff", "tongueOut"} <= set(table["filled"])
    assert set(table["filled"].values()) == {"ict"}
    assert "the mesh's own, kept: jawOpen, mouthSmileLeft, mouthSmileRight" in table["notes"]


@pytest.mark.slow
def test_lids_that_the_file_leaves_open_shut(filled) -> None:
    head, _, _ = filled
    subject = Subject(head)
    for side, name in enumerate(("eyeBlinkLeft", "eyeBlinkRight")):
        assert eye_opening(subject, side, subject.rest) > 7.0
        assert eye_opening(subject, side, subject.at_one(name)) <= 0.5
        assert eye_opening(subject, 1 - side, subject.at_one(name)) > 7.0


@pytest.mark.slow
def test_its_own_smile_stays_its_own_and_what_it_lacks_moves_as_on_the_head(filled) -> None:
    """How far the skin moves at most, beside the same on the shipped head."""
    ours, theirs = Subject(filled[0]), shipped()

    def most(subject: Subject, name: str) -> float:
        return float(np.linalg.norm(subject.moves(name)[0], axis=1).max())

    for name, share in (("mouthSmileLeft", HALF), ("jawOpen", 1.0), ("cheekPuff", 1.0), ("browInnerUp", 1.0)):
        assert most(ours, name) == pytest.approx(share * most(theirs, name), rel=0.15), name
