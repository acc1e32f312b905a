"""A mesh keeps its own shapes and gets those that it lacks."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from part_mesh import ICT, OFF_MM, part_mesh, shipped

from surface.base.errors import FitError
from surface.base.progress import no_progress
from surface.fit.filling import api
from surface.fit.filling.api import Filling, filled, own_shapes, with_shapes_of
from surface.fit.source.load import Loaded, LoadOptions
from surface.fit.source.names import map_names
from surface.head import Head
from surface.head.model.placement import Placement

OWN = ("jawOpen", "mouthSmileLeft", "mouthSmileRight")
LACKING = ("eyeBlinkLeft", "eyeSquintRight", "cheekPuff", "tongueOut")
FEET = Placement(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), 1000.0, np.array([5.0, -1500.0, 20.0]), "m")


@pytest.fixture(scope="module")
def trap() -> tuple:
    """The shipped head with smiles of half the usual size under other names, without a blink; moved from its file by
    one transform, while the head that fills it lies otherwise to that file."""
    mesh, ids = part_mesh((*OWN, *LACKING))
    half = mesh.deltas[: len(OWN)] * np.array([1.0, 0.5, 0.5])[:, None, None]
    names = ("Jaw_Open", "Mouth_Smile_L", "Mouth_Smile_R")
    shift = np.array([0.0, 40.0, -7.0])
    own = replace(mesh, vertices=mesh.vertices + shift, names=names, deltas=half)
    loaded = Loaded(own, map_names(names), placement=FEET.moved(shift))
    head = Head(replace(shipped().head.data, placement=FEET))
    return loaded, with_shapes_of(loaded, head, loaded.named.missing), mesh, ids


def test_its_own_shapes_stay_as_they_are(trap):
    loaded, after, _, _ = trap
    np.testing.assert_array_equal(after.mesh.deltas[: len(OWN)], loaded.mesh.deltas)
    assert [s.index for n in OWN for s in after.named.sources[n]] == [0, 1, 2]
    assert not set(OWN) & set(after.named.filled)


def test_those_that_it_lacks_are_the_heads(trap):
    _, after, mesh, ids = trap
    assert set(LACKING) <= set(after.named.filled) and not after.named.missing
    for name in LACKING[:3]:
        (source,) = after.named.sources[name]
        ours, theirs = after.mesh.deltas[source.index], mesh.deltas[mesh.names.index(name)]
        skin = ids["face"]
        off = np.linalg.norm(ours[skin] - theirs[skin], axis=1)
        assert np.sqrt((off**2).mean()) < 0.12 * np.sqrt((theirs[skin] ** 2).sum(axis=1).mean()) + 0.03, name


def test_a_tongue_comes_out_over_the_jaw_that_the_mesh_opens(trap):
    """All that happens at tongueOut is the head's; the part that its own jaw does already is not in the shape."""
    _, after, mesh, ids = trap
    (source,) = after.named.sources["tongueOut"]
    jaw = api.TONGUE_JAW * after.mesh.deltas[0]
    whole = after.mesh.deltas[source.index] + jaw
    own = ids["teeth_lower"]
    np.testing.assert_allclose(whole[own], mesh.deltas[mesh.names.index("tongueOut")][own], atol=0.1)


def test_notes_and_names_say_which_shape_came_from_where(trap):
    loaded, after, _, _ = trap
    kept, added = after.notes[len(loaded.notes) :]
    assert kept == "the mesh's own, kept: jawOpen, mouthSmileLeft, mouthSmileRight"
    assert added.startswith("filled in from the head 'ict'") and "eyeBlinkLeft" in added and "jawOpen" not in added
    made = after.named.made_of(after.mesh.names)
    assert made["eyeBlinkLeft"] == ["eyeBlinkLeft of the head 'ict'"] and made["jawOpen"] == ["Jaw_Open"]


def test_shapes_that_a_fit_makes_itself_are_not_filled_in(monkeypatch, trap):
    loaded, _, _, _ = trap
    asked = []
    monkeypatch.setattr(api, "read_scan", lambda *_: None)
    good = SimpleNamespace(head=shipped().head.data, report=SimpleNamespace(fit=SimpleNamespace(faults=())))
    monkeypatch.setattr(api, "transfer", lambda *given: asked.append(given) or good)
    monkeypatch.setattr(api, "with_shapes_of", lambda _, head, lacking: lacking)
    lacking = filled(loaded, "a.glb", Filling(ICT), LoadOptions(), no_progress)
    assert "eyeBlinkLeft" in lacking and not [n for n in lacking if n.startswith(("eyeLook", "mouthClose"))]
    options, seen = asked[0][4], asked[0][-1]
    assert (options.up, options.forward) == ("z", "x")  # as the mesh was found to stand
    corner = FEET.points(seen["left_eye_inner"]) - OFF_MM
    assert 10.0 < corner[0] < 25.0 and 25.0 < corner[1] < 40.0  # in the file's coordinates


def test_a_head_that_does_not_follow_the_mesh_fills_nothing(monkeypatch, trap):
    loaded, _, _, _ = trap
    bad = SimpleNamespace(head=None, report=SimpleNamespace(fit=SimpleNamespace(faults=("it is 9 mm off",))))
    monkeypatch.setattr(api, "read_scan", lambda *_: None)
    monkeypatch.setattr(api, "transfer", lambda *_: bad)
    with pytest.raises(FitError, match=r"a\.glb: the head 'ict' cannot be given its form: it is 9 mm off"):
        filled(loaded, "a.glb", Filling(ICT), LoadOptions(), no_progress)


def test_a_mesh_that_lacks_nothing_stays(trap):
    _, after, _, _ = trap
    assert filled(after, "a.glb", Filling(Path("nowhere")), LoadOptions(), no_progress) is after


@pytest.mark.parametrize(("names", "wanted"), [(("Jaw_Open", "rest"), ("jawOpen",)), (("rest",), ()), ((), ())])
def test_own_shapes_are_those_that_mean_a_parameter(tmp_path, names, wanted):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    deltas = np.ones((len(names), 3, 3))
    np.savez(
        tmp_path / "m.npz", neutral=corners, deltas=deltas, names=np.array(names, "U8"),
        faces=np.array([[0, 1, 2, -1]]), uv=np.zeros((3, 2)), face_uv=np.array([[0, 1, 2, -1]]),
    )  # fmt: skip
    assert own_shapes(tmp_path / "m.npz") == wanted
    assert own_shapes(tmp_path / "scan.ply") == ()
