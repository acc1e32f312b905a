"""From a mesh file to a head folder."""

import numpy as np
import pytest
from slit_sheet import slit_sheet, write_npz

from surface.base.errors import FitError
from surface.fit import fit_head
from surface.head import Head


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> tuple:
    folder = tmp_path_factory.mktemp("fit")
    heard: list[tuple[str, float]] = []
    report = fit_head(
        write_npz(folder / "m.npz", slit_sheet()),
        folder / "head",
        name="sheet",
        progress=lambda p, d: heard.append((p, d)),
    )
    return folder / "head", report, heard


def test_the_report_has_figures_for_every_part_and_shape(fitted):
    _, report, _ = fitted
    (face,) = report.parts
    assert report.name == "sheet" and report.points == face.points <= 2500
    assert set(face.shapes) == {"jawOpen", "mouthSmileLeft"}
    assert face.neutral.rms <= face.neutral.p99 <= face.neutral.max < 0.8
    assert face.mean_shape_rms == pytest.approx(np.mean([e.rms for e in face.shapes.values()]))
    assert report.parameters == ["jawOpen", "mouthSmileLeft"]


def test_progress_rises_to_the_end(fitted):
    _, _, heard = fitted
    done = [d for _, d in heard]
    assert {p for p, _ in heard} == {"face"} and done == sorted(done) and done[-1] <= 1


def test_the_head_loads_and_makes_the_shapes(fitted):
    folder, _, _ = fitted
    head = Head.load(folder)
    (part,) = head.parts
    assert part.material == "skin" and set(head.groups) == {"jawOpen", "mouthSmileLeft"}
    rest = part.vertices.copy()
    head.pose(head.values({"mouthSmileLeft": 1}))
    moved = (part.vertices - rest)[:, 2]
    assert 5.5 < moved.max() < 6.5
    head.pose(head.values({}))
    np.testing.assert_allclose(part.vertices, rest, atol=1e-4)


def test_the_lips_of_the_slit_part(fitted):
    folder, _, _ = fitted
    head = Head.load(folder)
    face = head.part("face")
    hole = head.data.parts[0].loops[1]
    middle = hole[:, 0].mean()
    wanted = [[middle, hole[:, 1].min()], [middle, hole[:, 1].max()]]
    edge = [int(np.argmin(np.linalg.norm(face.mesh.uv - at, axis=1))) for at in wanted]
    gap = [face.vertices[edge[1], 1] - face.vertices[edge[0], 1]]
    for value in (0.25, 0.5, 0.75, 1.0):
        head.pose(head.values({"jawOpen": value}))
        gap.append(face.vertices[edge[1], 1] - face.vertices[edge[0], 1])
    assert (np.diff(gap) > 2.5).all()
    assert gap[-1] - gap[0] > 12


def test_nothing_is_written_for_a_bad_mesh(tmp_path):
    path = write_npz(tmp_path / "m.npz", slit_sheet(), uv=None)
    with pytest.raises(FitError):
        fit_head(path, tmp_path / "head", name="bad")
    assert not (tmp_path / "head").exists()
