"""Groups made by hand: by places, numbers, rotations, mirror images and files made by dragging; mistakes are named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from relief import named, relief

from surface.base.errors import FitError
from surface.fit.surfaces import SurfaceOptions, head_of
from surface.head import Head, HeadData

SMILE = '[[groups]]\nname = "mouthSmileLeft"\n'
PLACE = SMILE + "at = [40.0, 0.0, 30.0]\nradius = 60.0\nmove = [0.0, 5.0, 1.0]\n"


def made(tmp_path: Path, *texts: str, unit: str = "mm") -> HeadData:
    paths = []
    for k, text in enumerate(texts):
        paths.append(tmp_path / (f"{k}.toml" if text.startswith("[") else f"{k}.json"))
        paths[-1].write_text(text)
    options = SurfaceOptions(unit=unit, up="y", forward="z", groups=tuple(paths))
    return head_of(named(sheet=relief()), name="h", options=options)


def moves(data: HeadData, name: str) -> np.ndarray:
    out = np.zeros_like(data.parts[0].points)
    for group in data.parts[0].groups:
        if group.name == name:
            out[group.ids] += group.moves
    return out


def test_points_near_a_place_move_most(tmp_path: Path) -> None:
    own = moves(made(tmp_path, PLACE), "mouthSmileLeft")
    off = np.linalg.norm(relief().points - [40, 0, 30], axis=1) / 60
    t = np.clip(off, 0, 1)
    np.testing.assert_allclose(own, (1 - t * t * (3 - 2 * t))[:, None] * [0, 5, 1], atol=1e-5)


def test_lengths_are_the_files(tmp_path: Path) -> None:
    np.testing.assert_allclose(
        moves(made(tmp_path, PLACE, unit="cm"), "mouthSmileLeft"),
        10 * moves(made(tmp_path, PLACE), "mouthSmileLeft"), atol=1e-4,
    )  # fmt: skip


def test_a_mirror_image_moves_the_other_side(tmp_path: Path) -> None:
    data = made(tmp_path, PLACE.replace("move = [0.0", "move = [3.0") + 'mirror = "mouthSmileRight"\n')
    left, right = (moves(data, f"mouthSmile{side}") for side in ("Left", "Right"))
    flip = np.arange(81).reshape(9, 9)[::-1].ravel()
    np.testing.assert_allclose(right[flip], left * [-1, 1, 1], atol=1e-5)
    assert left[:, 0].max() > 1


def test_groups_turn_about_a_hinge(tmp_path: Path) -> None:
    text = '[[groups]]\nname = "jawOpen"\nat = [0, 0, 0]\nradius = 1e6\n'
    text += "hinge = [0, 10, -20]\naxis = [2, 0, 0]\nangle_deg = 90\n"
    x, y, z = relief().points.T
    wanted = np.column_stack([x, 10 - (z + 20), -20 + (y - 10)]) - relief().points
    np.testing.assert_allclose(moves(made(tmp_path, text), "jawOpen"), wanted, atol=1e-3)


def test_points_by_number_and_by_part_of_u_and_v(tmp_path: Path) -> None:
    each = SMILE + 'part = "sheet"\nids = [3, 5]\nmove = [[1, 0, 0], [0, 2, 0]]\n'
    one = SMILE.replace("Smile", "Frown") + "ids = [7]\nmove = [0, 0, 4]\n"
    within = PLACE.replace("mouthSmileLeft", "browInnerUp") + "inside = [0.5, 1.0, 0.0, 0.5]\n"
    data = made(tmp_path, each + one + within)
    assert moves(data, "mouthSmileLeft")[[3, 5]].tolist() == [[1, 0, 0], [0, 2, 0]]
    assert np.flatnonzero(moves(data, "mouthFrownLeft").any(axis=1)).tolist() == [7]
    i, j = np.divmod(np.flatnonzero(moves(data, "browInnerUp").any(axis=1)), 9)
    assert i.min() >= 4 and j.max() <= 4 and len(i) > 3


def test_dragged_files_and_groups_of_one_name_add_up(tmp_path: Path) -> None:
    dragged = {"format": 1, "name": "cheekPuff", "part": "face", "ids": [4, 6], "moves_mm": [[0, 0, 1], [0, 0, 2]]}
    (tmp_path / "drag.json").write_text(json.dumps(dragged))
    twice = '[[groups]]\nname = "cheekPuff"\nfile = "drag.json"\namount = 0.5\n'
    own = moves(made(tmp_path, json.dumps(dragged), twice), "cheekPuff")
    np.testing.assert_allclose(own[[4, 6], 2], [1.5, 3.0])


def test_groups_move_the_head(tmp_path: Path) -> None:
    head = Head(made(tmp_path, PLACE))
    before = head.parts[0].vertices.copy()
    head.pose(head.values({"mouthSmileLeft": 1.0}))
    assert 2 < (head.parts[0].vertices - before)[:, 1].max() < 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[x]\n", "groups: must be a list"),
        ("[[groups]]\nname = 3\n", r"groups\[0\].name: 3 is no parameter"),
        ('[[groups]]\nname = "mouthSmilLeft"\n', "mouthSmilLeft"),
        (SMILE + "at = [1, 2]\n", r"at: must be 3 finite numbers"),
        (PLACE.replace("60.0", "1e300"), "radius: must be one finite numbers of usable size"),
        (SMILE + "radius = 1\n", "at: is missing"),
        (PLACE.replace("60.0", "-1"), "radius: -1 is not greater than 0"),
        (PLACE.replace("60.0", "0.01"), "moves no control point for mouthSmileLeft"),
        (PLACE + "rdius = 2\n", "rdius: is no key"),
        (PLACE + 'part = "nose"\n', "part: 'nose' is no surface"),
        (SMILE + "ids = [81]\nmove = [1, 0, 0]\n", "whole numbers from 0 to 80"),
        (SMILE + "ids = [0.5]\nmove = [1, 0, 0]\n", "whole numbers from 0 to 80"),
        (SMILE + "ids = [1, 2, 3]\nmove = [[1, 0, 0], [1, 0, 0]]\n", "2 displacements for 3"),
        (SMILE + 'ids = [1]\nmove = [1, 0, 0]\nmirror = "mouthSmileRight"\n', "only places can be mirrored"),
        (PLACE.replace("move", "hinge = [0,0,0]\naxis = [0,0,0]\nangle_deg = 3\nmove"), "axis: has no length"),
        (SMILE + 'file = "none.json"\n', "none.json"),
        ('{"name": "cheekPuff"}', "is no group file"),
        ("{", "0.json"),
    ],
)  # fmt: skip
def test_mistakes_name_file_place_and_key(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(FitError, match=why) as caught:
        made(tmp_path, text)
    assert (caught.value.hint and ".toml" in str(caught.value) + "") or ".json" in str(caught.value)


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    options = SurfaceOptions(groups=(tmp_path / "a.yaml",))
    with pytest.raises(FitError, match=r"is no group file: its name ends in \.yaml"):
        head_of(named(sheet=relief()), name="h", options=options)
