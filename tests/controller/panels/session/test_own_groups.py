"""Moved control points as parameters of a user's vocabulary: what is written, where they belong, what is refused."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.config import read_toml
from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.panels.session import own_groups as module
from controller.panels.session.own_groups import Place, place_of, save_corrective, save_own_group
from controller.stage.inverse import GroupMoves
from controller.vocabulary.vocabulary import Vocabulary
from surface.head.model.light import WEIGHT, LightPoints

BROWS = Place("brows", "brow")


def group(**other: Any) -> GroupMoves:
    fields = {"part": "face", "ids": np.array([3, 7], np.int32), "moves": np.array([[1.0, 0, 0], [0, 2.0, 0]])}
    return GroupMoves(**{**fields, **other})


def face(**values: float) -> np.ndarray:
    found = PARAMETERS.neutral()
    for name, value in values.items():
        found[PARAMETERS.index(name)] = value
    return found


@pytest.fixture
def known() -> Vocabulary:
    return Vocabulary.load(PARAMETERS)


def test_a_group_is_a_parameter_and_an_expression_that_has_it_at_one(tmp_path: Path, known: Vocabulary) -> None:
    path = tmp_path / "mine.toml"
    save_own_group(path, "dimple", group(), BROWS, known, PARAMETERS)
    table = read_toml(path)
    assert table["parameters"]["dimple"] == {
        "region": "brows", "profile": "brow", "range": [0.0, 1.0], "group": "dimple.json",
    }  # fmt: skip
    assert table["dimple"] == {"weights": {"dimple": 1.0}}
    assert (tmp_path / "dimple.json").is_file()
    more = PARAMETERS.with_files([path])
    assert Vocabulary.load(more, more=[path])["dimple"].weights[more.index("dimple")] == 1.0


@pytest.mark.parametrize(
    ("shown", "times"),
    [
        ({"jawOpen": 0.8}, ("jawOpen",)),
        ({"jawOpen": 0.8, "cheekPuff": 0.1, "mouthPucker": 0.09}, ("cheekPuff", "jawOpen")),
        ({"jawOpen": 0.9, "cheekPuff": 0.5, "mouthPucker": 0.8, "noseSneerLeft": 0.6},
         ("jawOpen", "mouthPucker", "noseSneerLeft")),
        ({"jawOpen": 0.8, "headYaw": 0.9}, ("jawOpen",)),
    ],
)  # fmt: skip
def test_a_corrective_comes_with_the_three_strongest_shapes_of_the_face(
    shown: dict[str, float], times: tuple[str, ...], tmp_path: Path, known: Vocabulary
) -> None:
    path = tmp_path / "mine.toml"
    found = save_corrective(path, "fold", group(), face(**shown), BROWS, known, PARAMETERS)
    assert sorted(found) == sorted(times)
    assert list(found) == sorted(found, key=PARAMETERS.index)
    entry = read_toml(path)["parameters"]["fold"]
    assert entry["times"] == list(found) and entry["rest"] == 1.0 and entry["range"] == [0.0, 1.0]
    assert (entry["region"], entry["profile"], entry["group"]) == ("brows", "brow", "fold.json")


def test_a_corrective_is_whole_in_the_face_it_was_made_in(
    tmp_path: Path, known: Vocabulary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its control points move by more, so that times the shapes they move as far as they were."""
    saved: list[GroupMoves] = []
    save = module.save_group
    monkeypatch.setattr(module, "save_group", lambda path, name, own: (saved.append(own), save(path, name, own)))
    shown = face(jawOpen=0.5, cheekPuff=0.4)
    save_corrective(tmp_path / "mine.toml", "fold", group(), shown, BROWS, known, PARAMETERS)
    np.testing.assert_allclose(saved[0].moves, group().moves / 0.2)


@pytest.mark.parametrize(
    ("shown", "strong"),
    [({}, False), ({"jawOpen": 0.09}, False), ({"jawOpen": 0.24, "cheekPuff": 0.2}, False),
     ({"jawOpen": 0.26, "cheekPuff": 0.2}, True)],
)  # fmt: skip
def test_a_corrective_belongs_to_a_face_that_shows(
    shown: dict[str, float], strong: bool, tmp_path: Path, known: Vocabulary
) -> None:
    """The product of its shapes is a twentieth or more."""
    path = tmp_path / "mine.toml"
    if strong:
        save_corrective(path, "fold", group(), face(**shown), BROWS, known, PARAMETERS)
    else:
        with pytest.raises(ParameterError, match="none of its shapes is strong"):
            save_corrective(path, "fold", group(), face(**shown), BROWS, known, PARAMETERS)
    assert path.exists() == strong


@pytest.mark.parametrize(
    ("name", "own", "why"),
    [
        ("jawOpen", group(), "there is a parameter 'jawOpen'"),
        ("two words", group(), "cannot be a name"),
        ("dimple", group(ids=np.zeros(0, np.int32), moves=np.zeros((0, 3))), "no control point was moved"),
    ],
)
def test_what_cannot_be_saved_says_why_and_leaves_nothing(
    name: str, own: GroupMoves, why: str, tmp_path: Path, known: Vocabulary
) -> None:
    with pytest.raises(ParameterError, match=why):
        save_own_group(tmp_path / "mine.toml", name, own, BROWS, known, PARAMETERS)
    assert list(tmp_path.iterdir()) == []


def test_files_of_the_user_are_kept(tmp_path: Path, known: Vocabulary) -> None:
    (tmp_path / "dimple.json").write_text("mine")
    with pytest.raises(ParameterError, match="there is such a file"):
        save_own_group(tmp_path / "mine.toml", "dimple", group(), BROWS, known, PARAMETERS)
    assert (tmp_path / "dimple.json").read_text() == "mine"
    (tmp_path / "damaged.toml").write_text("[")
    with pytest.raises(ConfigError):
        save_own_group(tmp_path / "damaged.toml", "smirk", group(), BROWS, known, PARAMETERS)
    assert not (tmp_path / "smirk.json").exists() and (tmp_path / "damaged.toml").read_text() == "["


def head_of(**shapes: tuple[list[int], float]) -> Any:
    """A head whose shapes move some control points of its face by so much, each."""
    groups = [
        SimpleNamespace(name=name, ids=np.array(ids, np.int32), moves=np.tile([0.0, far, 0.0], (len(ids), 1)))
        for name, (ids, far) in shapes.items()
    ]
    parts = [SimpleNamespace(name="eye", groups=[]), SimpleNamespace(name="face", groups=groups)]
    surface = SimpleNamespace(basis_matrix=lambda uv: np.eye(9)[np.rint(uv[:, 0]).astype(int)])
    return SimpleNamespace(data=SimpleNamespace(parts=parts), part=lambda name: SimpleNamespace(surface=surface))


def test_a_group_belongs_where_the_shape_does_that_moves_the_same_points_most() -> None:
    shapes = {"jawOpen": ([3], 5.0), "browDownLeft": ([7], 3.0), "own": ([3, 7], 50.0), "mouthLeft": ([1, 2], 90.0)}
    jaw = place_of(head_of(jawOpen=([3], 1.0)), group())
    assert jaw.region == "jaw"
    # point 7 moves twice as far as point 3: 6 of its shape's 3 mm, 5 of the jaw's
    assert place_of(head_of(**shapes), group()).region == "brows"
    assert place_of(head_of(**{**shapes, "jawOpen": ([3], 6.1)}), group()) == jaw
    assert place_of(head_of(mouthLeft=([1, 2], 90.0)), group()) == Place("mouth", "mouth")
    assert place_of(head_of(), group()) == Place("mouth", "mouth")


def test_added_points_count_as_the_heads_own_that_are_most_like_them() -> None:
    knots = np.array([[6.0, 6.5, 7.0, 7.5, 8.0], [4.0, 4.5, 5.0, 5.5, 6.0]])  # over points 7 and 5
    light = LightPoints("face", knots, knots)
    none = {"ids": np.zeros(0, np.int32), "moves": np.zeros((0, 3))}
    moves = np.array([[0.0, 0, 3.0], [0.0, 0, 1.0]]) / WEIGHT
    head = head_of(jawOpen=([5], 2.0), browDownLeft=([7], 1.0))
    assert place_of(head, group(**none, light=light, light_moves=moves)).region == "brows"
    assert place_of(head, group(**none, light=light, light_moves=moves[::-1])).region == "jaw"
    both = group(ids=np.array([5], np.int32), moves=np.array([[9.0, 0, 0]]), light=light, light_moves=moves)
    assert place_of(head, both).region == "jaw"
