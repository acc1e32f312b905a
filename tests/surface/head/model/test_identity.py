"""Identities: kept, mixed in, refused where they do not belong."""

import numpy as np
import pytest
from small_head import all_points, small_head

from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.model.data import Group
from surface.head.model.file import save_data
from surface.head.model.identity import Identity, fingerprint, load_identities, save_identities, with_identities


def wide(**other) -> Identity:
    """Both patches stand 4 mm further forward, the pucker of "a" is half as strong, eyes and hinge go along."""
    ids = np.arange(25, dtype=np.int32)
    forward = np.tile(np.float32([0, 0, 4]), (25, 1))
    weaker = Group("mouthPucker", np.array([11, 12, 13], np.int32), np.full((3, 3), [0, 0, -3], np.float32))
    fields = {
        "name": "wide", "groups": {n: Group("wide", ids, forward) for n in ("a", "b")}, "changes": {"a": [weaker]},
        "eyes": np.full((2, 3), [0, 0, 4.0]), "jaw": np.array([0, 1.0, 2.0]), "fit": fingerprint(small_head()), **other,
    }  # fmt: skip
    return Identity(**fields)


@pytest.fixture
def folder(tmp_path):
    save_data(tmp_path, small_head())
    save_identities(tmp_path, [wide(), wide(name="other", changes={})])
    return tmp_path


def test_they_come_back_as_they_were_kept(folder):
    found = load_identities(folder / "head.toml")
    assert list(found) == ["wide", "other"]
    want, got = wide(), found["wide"]
    np.testing.assert_array_equal(got.eyes, want.eyes)
    np.testing.assert_array_equal(got.jaw, want.jaw)
    assert got.fit == want.fit and set(got.groups) == {"a", "b"} and found["other"].changes == {}
    np.testing.assert_array_equal(got.groups["b"].moves, want.groups["b"].moves)
    np.testing.assert_array_equal(got.changes["a"][0].moves, want.changes["a"][0].moves)


def test_a_head_without_has_none(tmp_path):
    assert load_identities(tmp_path) == {}


def test_a_blend_moves_rest_shapes_eyes_and_hinge(folder):
    plain, mixed = Head.load(folder), Head.load(folder, {"wide": 0.5, "other": 0.25})
    shift = mixed.part("b").vertices - plain.part("b").vertices
    np.testing.assert_allclose(shift, np.broadcast_to([0, 0, 3.0], shift.shape), atol=1e-4)
    np.testing.assert_allclose(mixed.data.eyes - plain.data.eyes, np.full((2, 3), [0, 0, 3.0]))
    np.testing.assert_allclose(mixed.data.jaw.centre, [0, 0.75, 1.5])
    np.testing.assert_array_equal(mixed.part("tooth").vertices, plain.part("tooth").vertices)
    bulge = []
    for head in (plain, mixed):
        rest = head.part("a").vertices.copy()
        head.pose(head.values({"mouthPucker": 1.0}))
        bulge.append((head.part("a").vertices - rest)[:, 2].max())
    assert bulge[1] == pytest.approx(0.75 * bulge[0], rel=1e-3)


def test_borders_stay_closed(folder):
    head = Head.load(folder, {"wide": 1.0})
    one, two = (head.part(n).vertices for n in ("a", "b"))
    edge = two[np.abs(two[:, 0]) < 0.01]
    assert len(edge) > 4
    assert np.linalg.norm(edge[:, None] - one[None], axis=2).min(axis=1).max() < 0.5


@pytest.mark.parametrize(("wanted", "message"), [
    ({"tall": 1.0}, "no identity 'tall'; there are wide, other"), ({"wide": 1.5}, "1.5 is not between 0 and 1"),
    ({"wide": float("nan")}, "nan is not between"),
])  # fmt: skip
def test_wrong_names_and_amounts_are_refused(folder, wanted, message):
    with pytest.raises(HeadFileError, match=message):
        Head.load(folder, wanted)


def test_identities_of_another_fit_are_refused():
    head, group = small_head(), all_points("wide", (0, 0, 1))
    for stranger in (wide(fit=1), wide(groups={"a": group, "nose": group})):
        with pytest.raises(HeadFileError, match="was made for another fit"):
            with_identities(head, {"wide": stranger}, {"wide": 1.0}, "head")


def test_damage_is_named(folder):
    path = folder / "identities.npz"
    whole = path.read_bytes()
    rng = np.random.default_rng(2)
    for size in (0, 10, len(whole) // 2, *rng.integers(0, len(whole), 10)):
        path.write_bytes(whole[: int(size)])
        with pytest.raises(HeadFileError, match=r"identities\.npz"):
            load_identities(folder)


def test_a_group_holds_only_the_points_that_a_blend_moves():
    cancelled = Group("mouthPucker", np.array([11, 13, 20], np.int32), np.array([[0, 0, -6], [0, 0, -5], [1, 0, 0.0]]))
    blended = with_identities(small_head(), {"wide": wide(changes={"a": [cancelled]})}, {"wide": 1.0}, "here")
    (group,) = blended.parts[0].groups
    assert group.name == "mouthPucker" and group.ids.tolist() == [12, 13, 20]
    np.testing.assert_allclose(group.moves, [[0, 0, 6], [0, 0, 1], [1, 0, 0]])


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("omote/format", np.zeros(0, np.int64), "holds an array of another shape or kind"),
        ("fit", np.array(["x", "y"]), "holds an array of another shape or kind"),
        ("eyes", None, "has no array 'eyes'"),
        ("jaw", np.full((2, 3), np.nan), "or is not finite"),
        ("0/ids/a", np.arange(25) + 2**31, "an array of control points holds something else"),
    ],
)
def test_wrong_arrays_are_told_in_words_about_the_file(folder, key, value, message):
    """numpy's own say "index 0 is out of bounds for axis 0 with size 0"."""
    with np.load(folder / "identities.npz") as stored:
        arrays = {name: stored[name] for name in stored.files if name != key}
    np.savez(folder / "identities.npz", **arrays | ({} if value is None else {key: value}))
    with pytest.raises(HeadFileError, match=message):
        load_identities(folder)
