"""From a mesh file to a head folder."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import joined
from slit_sheet import slit_sheet, write_npz

from surface.base.errors import FitError, HeadFileError
from surface.fit import api, fit_head
from surface.fit.api import eyes_of, fit_mesh, measure_head, part_chart, prepare, recipe_plan
from surface.fit.eyes.lids import gazes_of
from surface.fit.features.generic import Plan
from surface.fit.features.pieces import HeadRig
from surface.fit.points.recipe import PartRecipe, Recipe
from surface.fit.points.refine import FitRequest
from surface.fit.points.report import FitResult
from surface.fit.points.strength import Strength
from surface.fit.source.islands import find_islands
from surface.fit.source.kinds import piece_kinds, worn_faces
from surface.fit.source.load import Loaded, worn_mesh
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names
from surface.head import Head
from surface.head.model.data import GREATEST_ERROR, Jaw
from surface.head.posing.fit_error import FIT_ERROR


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> tuple:
    folder = tmp_path_factory.mktemp("fit")
    heard: list[tuple[str, float]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("surface.fit.features.generic.FINEST", 0.9)  # fewer points take a quarter of the time
        report = fit_head(
            write_npz(folder / "m.npz", slit_sheet()),
            folder / "head",
            name="sheet",
            progress=lambda p, d: heard.append((p, d)),
        )
    return folder / "head", report, heard


@pytest.mark.slow
def test_the_report_has_figures_for_every_part_and_shape(fitted):
    _, report, _ = fitted
    (face,) = report.parts
    assert report.name == "sheet" and report.points == face.points <= 2500
    assert set(face.shapes) == {"jawOpen", "mouthSmileLeft"}
    assert face.neutral.rms <= face.neutral.p99 <= face.neutral.max < 0.8
    assert face.mean_shape_rms == pytest.approx(np.mean([e.rms for e in face.shapes.values()]))
    assert report.parameters == ["jawOpen", "mouthSmileLeft"]


def test_a_tongue_that_the_jaw_leaves_behind_is_taken_along_before_anything_is_fitted():
    sheet, (turn, pivot) = slit_sheet(), (0.35, np.array([0.0, 30.0, -60.0]))
    swing = np.array([[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]])
    whole = (sheet.vertices - pivot) @ swing.T + pivot - sheet.vertices
    below = sheet.vertices[:, 1] < 0
    sheet = replace(sheet, names=("jawOpen",), deltas=np.where(below[:, None], whole, 0.0)[None])
    tongue = replace(slit_sheet(), names=(), deltas=np.zeros((0, len(sheet.vertices), 3)))
    tongue = replace(tongue, vertices=0.1 * tongue.vertices + [0.0, -20.0, -30.0])
    mesh = joined([("Head", sheet), ("Tongue", tongue)])
    planned = api._planned(Loaded(mesh, map_names(mesh.names)), "m.npz")
    assert any(note.startswith("jawOpen left the tongue behind") for note in planned.plan.notes)
    own = planned.plan.vertices_of("tongue")
    rest = planned.mesh.vertices[own]
    moved = planned.mesh.deltas[planned.mesh.names.index("jawOpen")][own]
    assert len(own) == len(tongue.vertices) and np.linalg.norm(moved, axis=1).min() > 10.0
    apart = np.linalg.norm(np.diff(rest + moved, axis=0), axis=1)
    np.testing.assert_allclose(apart, np.linalg.norm(np.diff(rest, axis=0), axis=1), atol=1e-6)  # as a whole


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


def test_how_far_the_head_is_from_the_mesh_is_kept_beside_it(fitted):
    folder, report, _ = fitted
    mm = Head.load(folder).part("face").attributes["fit_error"]
    assert np.isfinite(mm).all() and 0.0 < np.sqrt(np.mean(mm**2)) <= report.parts[0].neutral.rms + 0.01


def test_a_head_that_is_there_is_measured_again_beside_its_own_mesh_alone(fitted, tmp_path):
    folder, _, _ = fitted
    kept = (folder / FIT_ERROR).read_bytes()
    (folder / FIT_ERROR).unlink()
    found = measure_head(folder, folder.parent / "m.npz")
    assert np.allclose(found["face"], Head.load(folder).part("face").attributes["fit_error"], atol=0.006)
    assert (folder / FIT_ERROR).stat().st_size == len(kept)
    sheet = slit_sheet()
    other = write_npz(tmp_path / "m.npz", replace(sheet, vertices=sheet.vertices * [1.0, 1.0, 1.6]))
    with pytest.raises(FitError, match=r"was not fitted to .* mm RMS from it"):
        measure_head(folder, other)
    assert np.isfinite(Head.load(folder).part("face").attributes["fit_error"]).all()


def test_what_was_measured_before_stays_where_the_disk_is_full(fitted, monkeypatch):
    folder, _, _ = fitted
    kept = (folder / FIT_ERROR).read_bytes()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(HeadFileError, match="cannot be written"):
        measure_head(folder, folder.parent / "m.npz")
    assert (folder / FIT_ERROR).read_bytes() == kept


def test_nothing_is_written_for_a_bad_mesh(tmp_path):
    path = write_npz(tmp_path / "m.npz", slit_sheet(), faces=None)
    with pytest.raises(FitError):
        fit_head(path, tmp_path / "head", name="bad")
    assert not (tmp_path / "head").exists()


def test_a_head_that_does_not_follow_its_mesh_is_put_elsewhere_unless_forced(tmp_path, fitted, monkeypatch):
    folder, report, _ = fitted
    bad = FitResult(Head.load(folder).data, replace(report, faults=("it is 48 mm off the mesh",)), [])
    monkeypatch.setattr(api, "fit_mesh", lambda *_: bad)
    path, out = write_npz(tmp_path / "m.npz", slit_sheet()), tmp_path / "head"
    with pytest.raises(FitError, match="refused: it is 48 mm off the mesh; it was written to ") as caught:
        fit_head(path, out, name="bad")
    assert "--force" in caught.value.hint and not out.exists()
    assert Head.load(tmp_path / "head-refused").data.name == "sheet"
    assert fit_head(path, out, name="bad", force=True).faults and Head.load(out).data.name == "sheet"


def sphere(centre: np.ndarray, radius: float) -> np.ndarray:
    a, b = (x.ravel() for x in np.meshgrid(np.linspace(0.1, 1.4, 6), np.linspace(0, 2 * np.pi, 9)))
    return centre + radius * np.column_stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])


def part(name: str, vertices: list[tuple[int, int]], **other) -> PartRecipe:
    return PartRecipe(name, "skin", "skin", vertices, FitRequest(200, coarse=0.2), (0, 0.5, 4), **other)


def test_a_head_nothing_is_known_of_gets_a_neck_in_its_lower_quarter(fitted):
    folder, report, _ = fitted
    data = Head.load(folder).data
    z = slit_sheet().vertices[:, 2]
    assert data.neck.pivot == pytest.approx((0.0, -40.0, 0.5 * (z.min() + z.max())))
    assert (data.neck.slope, data.neck.still, data.neck.whole) == pytest.approx((0.0, -96.0, -60.0))
    assert data.eye_radius == 0.0 and not data.eyes.any() and list(data.provenance) == ["made", GREATEST_ERROR]
    assert data.provenance[GREATEST_ERROR] == str(report.dense.greatest)
    assert report.scale == pytest.approx(200.0 / 338.0)
    assert "eyeBlinkLeft" in report.missing and "jawOpen" not in report.missing


def test_a_mesh_is_kept_for_the_face_so_that_it_starts_at_once(fitted):
    assert all(p.stored for p in Head.load(fitted[0]).parts)


def test_a_recipe_names_its_eyes_neck_and_source():
    mesh = slit_sheet()
    ball = sphere(np.array([30.0, 20.0, 60.0]), 15.0)
    vertices = np.vstack([mesh.vertices, ball])
    mesh, n = replace(mesh, vertices=vertices, deltas=np.zeros((2, len(vertices), 3))), len(vertices)
    recipe = Recipe([], ball=(n - len(ball), n), ball_inset=0.5, eye_shift=(1.0, -2.0, 3.0), eye_radius=12.0)
    eyes, radius = eyes_of(mesh, recipe)
    np.testing.assert_allclose(eyes, [[31.0, 18.0, 63.0], [-31.0, 18.0, 63.0]], atol=1e-6)
    assert radius == 12.0
    old, new = recipe.eyeballs(mesh)
    assert old.radius == pytest.approx(14.5) and new.radius == 12.0
    assert eyes_of(mesh, Recipe([]))[1] == 0.0 and Recipe([]).eyeballs(mesh) is None


def test_preparing_without_a_recipe_changes_nothing_and_with_one_strengthens_blinks_and_closes_lips():
    mesh = replace(slit_sheet(), names=("mouthClose", "eyeBlink_L"))
    same = prepare(mesh, Recipe([]))
    np.testing.assert_array_equal(same.vertices, mesh.vertices)
    np.testing.assert_array_equal(same.deltas, mesh.deltas)
    made = prepare(mesh, Recipe([], lips_close=0.25, strengthened=[Strength("eyeBlink", 1.5)]))
    np.testing.assert_allclose(made.vertices, mesh.vertices + 0.25 * mesh.deltas[0])
    np.testing.assert_allclose(made.deltas, [0.75 * mesh.deltas[0], 1.5 * mesh.deltas[1]])


def whole_sheet() -> FitMesh:
    """A sheet of 4 x 4 quads without a hole, over the unit square."""
    s = np.linspace(0, 1, 5)
    uv = np.stack(np.meshgrid(s, s, indexing="ij"), axis=-1).reshape(-1, 2)
    at = np.arange(25).reshape(5, 5)
    faces = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    return FitMesh(np.column_stack([100 * uv, 0 * uv[:, 0]]), faces, uv, faces.copy(), (), np.zeros((0, 25, 3)))


def test_parts_of_a_recipe_get_their_islands_and_those_without_are_left_out():
    mesh = whole_sheet()
    recipe = Recipe([part("face", [(0, 5), (12, 13)]), part("none", [(13, 99)])], jaw_teeth=(3, 7), hinge=[0, 6, 12])
    plan = recipe_plan(mesh, recipe)
    assert [(p.name, p.tiled, len(islands)) for p, islands in plan.parts] == [("face", False, 1)]
    assert plan.jaw.tolist() == [3, 4, 5, 6] and plan.hinge.tolist() == [0, 6, 12] and plan.eyes[1] == 0.0
    for uv in (mesh.uv * 0.6, mesh.uv + 0.1, mesh.uv - 0.1, mesh.uv * [1.0, 0.6]):  # not the whole unit square
        assert recipe_plan(replace(mesh, uv=uv), recipe).parts[0][0].tiled
    assert not recipe_plan(replace(mesh, uv=0.8 * mesh.uv + 0.1), recipe).parts[0][0].tiled
    half = replace(mesh, uv=0.8 * mesh.uv)
    kept, islands = recipe_plan(half, recipe).parts[0]
    tiled, _ = recipe_plan(replace(mesh, uv=0.6 * mesh.uv), recipe).parts[0]
    assert part_chart(half, kept, islands).uv.max() == pytest.approx(0.8)
    assert part_chart(half, tiled, islands).uv.max() == pytest.approx(1.0)


def test_eyes_look_where_their_shapes_say_and_else_ahead():
    mesh = replace(whole_sheet(), names=("jawOpen", "eyeLookDownLeft", "eyeLookOutRight"), deltas=np.zeros((3, 25, 3)))
    jaw, down, out = gazes_of(mesh)
    np.testing.assert_array_equal(jaw, [[0, 0, 1], [0, 0, 1]])
    assert down[1].tolist() == [0, 0, 1] and out[0].tolist() == [0, 0, 1]
    assert down[0][1] < -0.2 and down[0][0] == pytest.approx(0.0, abs=1e-9)
    assert out[1][0] < -0.2 and out[1][1] == pytest.approx(0.0, abs=1e-9)  # the right eye looks to the subject's right
    np.testing.assert_allclose(np.linalg.norm([jaw, down, out], axis=2), 1.0)
    named = replace(mesh, names=("jawOpen", "eyeLookUp_L", "nothing"))
    assert gazes_of(named)[1][0][1] > 0.2 and gazes_of(named)[2].tolist() == [[0, 0, 1], [0, 0, 1]]


@pytest.mark.slow
def test_a_part_that_cannot_be_fitted_is_left_out_by_name_and_the_face_never_is(monkeypatch):
    small = slit_sheet()
    hair = replace(small, vertices=0.4 * small.vertices + [0.0, 90.0, 5.0], names=(), deltas=small.deltas[:0])
    mesh = joined([("Face", small), ("Hair", hair)])
    monkeypatch.setattr("surface.fit.features.generic.FINEST", 2.0)  # few points: their place does not matter here
    monkeypatch.setattr("surface.fit.features.generic.POINTS", 300)
    for rms, p99, parts in ((1e3, 1e3, ["face", "brow_1"]), (0.0, 1e3, ["face"]), (1e3, 0.0, ["face"])):
        monkeypatch.setattr(api, "LOOSE_MM", rms)
        monkeypatch.setattr(api, "LOOSE_99_MM", p99)
        most = min(rms, p99)
        loaded = Loaded(
            mesh, map_names(mesh.names), pieces={"Face": "skin", "Hair": "hair", "Shirt": "clothes, left out"}
        )
        result = fit_mesh(loaded, "me", lambda *_: None)
        assert [part.name for part in result.report.parts] == parts
        said = "in the mesh, but left out and not drawn: brows or hair" in result.report.notes
        assert said == (most == 0.0)
        assert [p.name for p in result.head.parts if p.follows == "skin"] == parts
        assert any("brow_1: left out: it cannot be fitted" in note for note in result.report.notes) == (most == 0.0)


@pytest.mark.slow
def test_a_mouth_is_redrawn_in_the_head_that_is_given_back(monkeypatch):
    monkeypatch.setattr("surface.fit.features.generic.FINEST", 2.0)
    monkeypatch.setattr("surface.fit.features.generic.POINTS", 300)
    monkeypatch.setattr(api, "redrawn_mouth", lambda head, recipe: replace(head, name="redrawn"))
    mesh = slit_sheet()
    assert fit_mesh(Loaded(mesh, map_names(mesh.names)), "me", lambda *_: None).head.name == "redrawn"


@pytest.mark.parametrize("exported", [False, True])
def test_lashes_of_an_exported_head_are_not_cut_into_hairs_again(monkeypatch, exported):
    """A solid lash of a drawn character stays solid when its head is exported and fitted again."""
    mesh, cut, combs = slit_sheet(), [], []
    plan = Plan(
        [(replace(part("lash_1", []), material="lash"), find_islands(mesh))], (np.zeros((2, 3)), 12.0), np.zeros(3), []
    )
    rig = HeadRig({}, Jaw((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0)), np.array([[0.0, 0, 20], [9, 0, 20]]), 12.0)
    monkeypatch.setattr(api, "combed", lambda own, *_: cut.append(own.name) or own)

    def fit_parts(*arguments, comb):
        combs.append(comb)
        raise RuntimeError("far enough")

    api._fit_parts(mesh, Recipe([]), plan, rig, lambda *_: None, comb=not exported)
    assert cut == ([] if exported else ["lash_1"])
    monkeypatch.setattr(api, "_fit_parts", fit_parts)
    with pytest.raises(RuntimeError, match="far enough"):
        fit_mesh(Loaded(mesh, map_names(mesh.names), exported=exported), "me", lambda *_: None)
    assert combs == [not exported]


def test_a_mesh_without_height_is_refused(tmp_path):
    """Its size is 0, by which everything would be divided."""
    path = tmp_path / "flat.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\n")
    with pytest.raises(FitError, match=r"flat\.obj: lies flat: it has no height") as caught:
        fit_head(path, tmp_path / "head", name="flat")
    assert "--up" in caught.value.hint and list(tmp_path.iterdir()) == [path]


def test_what_is_worn_does_not_hide_the_kinds_of_other_pieces():
    sheet = slit_sheet()
    mesh = replace(sheet, pieces=("Face", "Teeth", "Hair"), piece=np.arange(len(sheet.faces)) % 3)
    mesh = replace(mesh, names=(), deltas=mesh.deltas[:0])
    aside = worn_faces(mesh)
    worn, damage = worn_mesh(mesh, aside, "a mesh")
    loaded = Loaded(mesh, map_names(()), pieces=piece_kinds(mesh, ~aside), worn=worn)
    assert not damage
    assert aside.sum() == (mesh.piece == 2).sum()
    assert api._kinds(loaded) == {"skin", "teeth"}
    assert api._kinds(replace(loaded, worn=None)) == {"skin", "teeth", "hair"}
