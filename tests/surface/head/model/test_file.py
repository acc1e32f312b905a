"""Head files: a round trip, and every kind of damage named by file and key."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head.model.data import Contact, Rule, Seal
from surface.head.model.file import check_writable, load_data, save_data


@pytest.fixture
def folder(tmp_path):
    save_data(tmp_path / "h", small_head())
    return tmp_path / "h"


def broken(folder, match: str) -> None:
    with pytest.raises(HeadFileError, match=match) as e:
        load_data(folder)
    assert e.value.hint


def change(folder, **arrays) -> None:
    with np.load(folder / "head.npz") as z:
        old = {k: z[k] for k in z.files}
    new = {**old, **{k.replace("__", "/"): v for k, v in arrays.items()}}
    np.savez(folder / "head.npz", **{k: v for k, v in new.items() if v is not None})


def edit(folder, old: str, new: str) -> None:
    path = folder / "head.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_everything_comes_back(folder):
    want, got = small_head(), load_data(folder)
    assert (got.name, got.provenance, got.neck, got.paint) == (want.name, want.provenance, want.neck, want.paint)
    assert got.jaw.angle_rad == want.jaw.angle_rad and got.jaw.glide == want.jaw.glide
    np.testing.assert_array_equal(got.jaw.tilts["jawForward"], want.jaw.tilts["jawForward"])
    for a, b in zip(want.parts, got.parts, strict=True):
        assert (a.name, a.material, a.follows, a.budget) == (b.name, b.material, b.follows, b.budget)
        for key in ("points", "weights", "knots_u", "knots_v", "degrees", "slits", "jaw", "lids"):
            np.testing.assert_array_equal(getattr(a, key), getattr(b, key))
        np.testing.assert_array_equal(a.loops[0], b.loops[0])
        assert [g.name for g in a.groups] == [g.name for g in b.groups]
    np.testing.assert_array_equal(got.parts[0].groups[0].moves, want.parts[0].groups[0].moves)
    np.testing.assert_array_equal(got.seams[0].uv_b, want.seams[0].uv_b)


def test_the_path_of_the_toml_will_do(folder):
    assert load_data(folder / "head.toml").name == "small"


@pytest.mark.parametrize("name", ["left eye", "a.b", 'quo"ted', "links/ä", "[x]", "# no", "1 = 2"])
def test_any_name_of_a_part_comes_back(tmp_path, name):
    head = small_head(parts=[replace(small_head().parts[0], name=name)], seams=[])
    other = replace(head, provenance={name: name}, jaw=replace(head.jaw, tilts={name: np.ones((3, 4))}),
                    rules=[Rule(name, ({"jawOpen": 1.0}, {"jawLeft": 0.5, "jawRight": 0.25}), 3.0)])  # fmt: skip
    save_data(tmp_path, other)
    got = load_data(tmp_path)
    assert got.parts[0].name == name and got.provenance == {name: name} and got.rules == other.rules
    assert list(got.jaw.tilts) == [name]
    np.testing.assert_array_equal(got.parts[0].points, other.parts[0].points)


def test_contacts_come_back(folder):
    places = np.arange(36.0).reshape(2, 3, 3, 2)
    for cling in (True, False):
        want = Contact("lids", "a", ("b", "tooth"), 1, 5.5, 0.75, places, cling)
        save_data(folder, small_head(contacts=[want]))
        (got,) = load_data(folder).contacts
        assert replace(got, places=want.places) == want
        np.testing.assert_array_equal(got.places, places)
        assert got.places.dtype == float
        assert ("cling" in (folder / "head.toml").read_text()) == (not cling)
    edit(folder, "cling = false", "cling = 0")
    broken(folder, "cling: 0 is neither true nor false")


def test_a_seal_comes_back_and_names_shapes(folder):
    lips = Contact("lips", "a", ("b",), -1, 5.5, 0.5, np.zeros((2, 3, 3, 2)), seal=Seal({"jawOpen": 3.0}, 0.25, 0.75))
    save_data(folder, small_head(contacts=[lips]))
    assert load_data(folder).contacts[0].seal == lips.seal
    edit(folder, "parted = 0.75", "parted = 0.25")
    broken(folder, r"contacts\[0\]\.seal\.parted: 0\.25 is not greater than closed, 0\.25")
    edit(folder, "jawOpen = 3.0", "grin = 3.0")
    broken(folder, r"contacts\[0\]\.seal\.opens: no shape 'grin'")


def test_a_truth_value_is_no_number(folder):
    save_data(folder, small_head(contacts=[Contact("lids", "a", ("b",), 1, 5.5, 0.75, np.zeros((2, 3, 3, 2)))]))
    edit(folder, "eye = 1", "eye = true")
    broken(folder, r"contacts\[0\]\.eye: True is of the wrong kind")


def test_an_edited_rule_needs_numbers(folder):
    save_data(folder, small_head(rules=[Rule("fold", ({"jawOpen": 1.0},), 2.0)]))
    edit(folder, "jawOpen = 1.0", 'jawOpen = "much"')
    broken(folder, r"rules\[0\]\.terms\[0\]\.jawOpen: 'much' is of the wrong kind")


def test_no_folder(tmp_path):
    broken(tmp_path / "nowhere", "nowhere: no such head folder")


@pytest.mark.parametrize("name", ["head.toml", "head.npz"])
def test_a_missing_file(folder, name):
    (folder / name).unlink()
    broken(folder, f"{name}: file: missing")


@pytest.mark.parametrize("keep", [0, 50, 3000])
def test_a_file_cut_short(folder, keep):
    data = (folder / "head.npz").read_bytes()
    (folder / "head.npz").write_bytes(data[:keep])
    broken(folder, r"head\.npz: not a sound archive")


def test_a_flipped_byte(folder):
    data = bytearray((folder / "head.npz").read_bytes())
    for at in range(200, len(data) // 2, 37):
        data[at] ^= 0xFF
    (folder / "head.npz").write_bytes(bytes(data))
    broken(folder, r"head\.npz")


def test_broken_toml(folder):
    edit(folder, "[pivots]", "[pivots")
    broken(folder, r"head\.toml: not valid TOML.*line")


def test_another_version(folder):
    edit(folder, "format = 1", "format = 99")
    broken(folder, r"head\.toml: format: is 99, this omote reads up to 2")


def test_a_missing_key(folder):
    edit(folder, "pivot = ", "pilot = ")
    broken(folder, r"head\.toml: neck\.pivot: missing")


def test_a_wrong_kind(folder):
    edit(folder, 'material = "skin"', "material = 3")
    broken(folder, r"head\.toml: parts\[0\]\.material: 3 is of the wrong kind")


def test_a_word_among_numbers(folder):
    edit(folder, "pivot = [\n    0.0,", 'pivot = ["zero",')
    broken(folder, r"neck\.pivot: holds something that is not a number")


def test_a_missing_array(folder):
    change(folder, a__points=None)
    broken(folder, r"head\.npz: a/points: missing")


def test_an_array_of_another_length(folder):
    change(folder, a__weights=np.ones(24))
    broken(folder, r"a/weights: has shape \(24,\), expected \(25,\)")


def test_nan_in_an_array(folder):
    change(folder, b__points=np.full((25, 3), np.nan))
    broken(folder, "b/points: holds something that is not a finite number")


@pytest.mark.parametrize("kind", ["<i8", ">f8", "<f2", "<u4", "<f4"])
def test_arrays_come_in_one_type_whatever_they_were_stored_in(folder, kind):
    want = load_data(folder).parts[0]
    points = np.asfortranarray(np.round(want.points), kind)
    change(folder, a__points=points, a__weights=np.ones(25, kind), a__group_ids=np.array([11, 12, 13], kind))
    got = load_data(folder).parts[0]
    assert got.points.dtype == got.weights.dtype == want.points.dtype and got.points.flags.c_contiguous
    np.testing.assert_array_equal(got.points, points)
    assert got.groups[0].ids.dtype == want.groups[0].ids.dtype and got.groups[0].ids.tolist() == [11, 12, 13]


@pytest.mark.parametrize(
    ("key", "value", "match"),
    [
        ("a__group_ids", np.array([11, 12.5, 13]), "a/group_ids: holds numbers that are no int32"),
        ("a__group_ids", np.array([11, 2**32 + 12, 13]), "a/group_ids: holds numbers that are no int32"),
        ("a__degrees", np.full((25, 2), 300), "a/degrees: holds numbers that are no int8"),
        ("a__group_moves", np.full((3, 3), 1e300), "a/group_moves: holds numbers that are no float32"),
    ],
)
def test_numbers_that_the_type_cannot_hold_are_refused(folder, key, value, match):
    change(folder, **{key: value})
    broken(folder, match)


def test_a_group_that_points_nowhere(folder):
    change(folder, a__group_ids=np.array([11, 12, 25], np.int32))
    broken(folder, r"a/group_ids: points at a control point that is not there")


def test_ends_that_do_not_match(folder):
    change(folder, a__group_ends=np.array([2], np.int32))
    broken(folder, "a/group_ends: does not match")


def test_a_group_without_a_name(folder):
    edit(folder, '    "mouthPucker",\n', "")
    broken(folder, "0 names for 1 groups")


def test_a_seam_of_an_unknown_part(folder):
    edit(folder, 'b = "b"', 'b = "c"')
    broken(folder, "no part is named 'c'")


@pytest.mark.parametrize(
    ("part", "follower", "eye", "match"),
    [
        ("c", "b", -1, r"contacts\[0\]\.part: no part is named 'c'"),
        ("a", "c", -1, r"contacts\[0\]\.followers: no part named 'c' stands after 'a'"),
        ("b", "a", -1, "no part named 'a' stands after 'b'"),
        ("a", "b", 2, r"contacts\[0\]\.eye: 2 is not -1"),
    ],
)
def test_a_contact_of_what_is_not_there(folder, part, follower, eye, match):
    wrong = Contact("lips", part, (follower,), eye, 5.0, 0.5, np.zeros((2, 3, 3, 2)))
    save_data(folder, small_head(contacts=[wrong]))
    broken(folder, match)


@pytest.mark.parametrize("key", ["seams", "parts", "rules"])
def test_an_entry_that_is_no_table(folder, key):
    table = tomllib.loads((folder / "head.toml").read_text())
    (folder / "head.toml").write_text(tomli_w.dumps(table | {key: [0.1]}))
    broken(folder, rf"{key}\[0\]: 0\.1 is no table")


def test_a_full_disk_leaves_the_old_head(folder, full_disk):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    full_disk(2000)
    with pytest.raises(HeadFileError, match=r"the head cannot be written \(.*File too large"):
        save_data(folder, small_head())
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_an_interrupt_leaves_the_old_head(folder, monkeypatch):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    monkeypatch.setattr("tomli_w.dumps", lambda table: exec("raise KeyboardInterrupt"))
    with pytest.raises(KeyboardInterrupt):
        save_data(folder, small_head())
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_places_that_cannot_be_written_are_known_beforehand(folder, tmp_path, monkeypatch):
    check_writable(tmp_path / "new" / "deep")
    assert not (tmp_path / "new").exists()
    with pytest.raises(HeadFileError, match=r"head\.npz is no folder"):
        check_writable(folder / "head.npz" / "deep")
    monkeypatch.setattr("os.access", lambda place, mode: place != folder)
    with pytest.raises(HeadFileError, match="h may not be written to"):
        check_writable(folder / "new")
