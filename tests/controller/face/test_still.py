"""What the words of ``omote render`` mean, and what is wrong with wrong ones."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.face.still import (
    Still,
    crowd_poses,
    draw_crowd,
    draw_still,
    for_head,
    parse_group,
    parse_setting,
    parse_size,
    sheet_poses,
)
from surface.head import Head


def test_a_setting_names_a_parameter_in_any_spelling() -> None:
    jaw = PARAMETERS.index("jawOpen")
    assert parse_setting("jawOpen=0.8") == ([jaw], 0.8)
    assert parse_setting("JawOpen=1") == ([jaw], 1.0)
    assert parse_setting("headYaw=-1")[1] == -1.0


def test_a_setting_without_a_side_means_both() -> None:
    both = [PARAMETERS.index(f"noseSneer{side}") for side in ("Left", "Right")]
    assert parse_setting("noseSneer=0.7") == (both, 0.7)
    with pytest.raises(ParameterError, match="noseSneerLeft goes from 0 to 1"):
        parse_setting("noseSneer=1.5")


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("jawOpen", "expected NAME=VALUE"),
        ("jawOpn=1", "did you mean 'jawOpen'"),
        ("jawOpen=1.2", "jawOpen goes from 0 to 1"),
        ("headYaw=-1.1", "headYaw goes from -1 to 1"),
        ("jawOpen=wide", "'wide' is not a number"),
        ("jawOpen=nan", "'nan' is not a number"),
        ("jawOpen=", "'' is not a number"),
    ],
)
def test_a_wrong_setting_is_told(word: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        parse_setting(word)


def test_sizes() -> None:
    assert parse_size("1280x720") == (1280, 720)
    for wrong in ("800", "0x800", "800x", "axb", "8x8", "99999x100", "-1x5"):
        with pytest.raises(ParameterError, match="WIDTHxHEIGHT"):
            parse_size(wrong)


def test_the_sheet_shows_every_end_of_every_parameter() -> None:
    poses = sheet_poses()
    labels = [label for label, _ in poses]
    assert len(set(labels)) == len(labels)
    reached = np.array([values for _, values in poses])
    assert (reached.min(axis=0) == PARAMETERS.low).all()
    assert (reached.max(axis=0) == PARAMETERS.high).all()


def test_values_reach_a_head_in_its_own_order() -> None:
    values = np.arange(len(PARAMETERS.names), dtype=float)
    wanted = ("jawOpen", "somethingElse", "eyeBlinkLeft")
    assert for_head(values, wanted).tolist() == [PARAMETERS.index("jawOpen"), 0.0, PARAMETERS.index("eyeBlinkLeft")]


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A stage with an expression and a group of the user's own."""
    (tmp_path / "mine.toml").write_text("[grin]\nweights = { mouthSmile = 0.9 }\n")
    (tmp_path / "dimple.json").write_text(
        '{"format": 1, "name": "dimple", "part": "face", "ids": [7], "moves_mm": [[0, 0, 4]]}'
    )
    (tmp_path / "stage.toml").write_text(
        'name = "own"\nvocabularies = ["mine.toml"]\nidentity = { broad = 0.5 }\n'
        '[groups]\n"dimple.json" = 0.5\n[face]\nsize = [320, 200]\ntheme = "mask"\n'
    )
    return tmp_path


def test_a_stage_lends_a_picture_its_head_expressions_and_look(own: Path) -> None:
    still = Still.parse([], ["grin=0.5"], stage=str(own / "stage.toml"))
    assert still.values[PARAMETERS.index("mouthSmileLeft")] == pytest.approx(0.45)
    assert (still.size, still.look.theme, still.identity) == ((320, 200), "mask", {"broad": 0.5})
    assert still.groups == ((own / "dimple.json", 0.5),)
    assert "grin" in dict(sheet_poses(still.vocabulary))
    said = Still.parse([], [], "64x64", {"theme": "skin", "camera": None}, identity="", stage=str(own / "stage.toml"))
    assert (said.size, said.look.theme, said.identity) == ((64, 64), "skin", {})


@pytest.mark.slow
def test_large_pictures_have_rounder_skin_than_small_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[int] = []
    loaded = Still.load_head

    def count(self: Still, chord_mm: float | None = None) -> Head:
        head = loaded(self, chord_mm)
        counts.append(len(head.part("face").vertices))
        return head

    monkeypatch.setattr(Still, "load_head", count)
    for size in ("800x800", "64x2048"):
        draw_still(Still.parse([], [], size), tmp_path / "out.png")
    assert counts[0] == len(Still.parse([], []).load_head().part("face").vertices) < counts[1] / 2


@pytest.mark.slow
def test_a_picture_wears_groups_and_expressions_named_on_the_command_line(own: Path) -> None:
    still = Still.parse(
        [], ["grin"], vocabularies=[str(own / "mine.toml")], groups=[f"{own / 'dimple.json'}=-0.5"]
    )  # fmt: skip
    worn, plain = still.load_head(), Still.parse([], []).load_head()
    rest = np.zeros(len(worn.parameters))
    for head in (worn, plain):
        head.pose(rest)
    moved = worn.part("face").control_points - plain.part("face").control_points
    assert moved[7] == pytest.approx([0, 0, -2.0])
    assert np.count_nonzero(moved.any(axis=1)) == 1
    assert still.values[PARAMETERS.index("mouthSmileRight")] == pytest.approx(0.9)


def test_wrong_groups_are_told(own: Path) -> None:
    with pytest.raises(ParameterError, match="from -1 to 1"):
        parse_group(f"{own / 'dimple.json'}=2")
    with pytest.raises(ParameterError, match="'x' is not a number"):
        parse_group(f"{own / 'dimple.json'}=x")
    with pytest.raises(ConfigError, match=r"none\.json"):
        parse_group("none.json")


def test_amounts_reach_from_end_to_end(own: Path) -> None:
    group = str(own / "dimple.json")
    assert [parse_group(f"{group}{end}")[1] for end in ("=-1", "=1", "")] == [-1.0, 1.0, 1.0]
    with pytest.raises(ParameterError, match="from -1 to 1"):
        parse_group(f"{group}=-1.01")
    jaw = PARAMETERS.index("mouthSmileLeft")
    vocabulary = [str(own / "mine.toml")]
    for word, value in (("grin=0", 0.0), ("grin=1", 0.9), ("grin", 0.9)):
        assert Still.parse([], [word], vocabularies=vocabulary).values[jaw] == pytest.approx(value)
    for word in ("grin=1.01", "grin=-0.01"):
        with pytest.raises(ParameterError, match="intensity goes from 0 to 1"):
            Still.parse([], [word], vocabularies=vocabulary)
    both = Still.parse(["mouthSmileLeft=0.1"], ["grin", "grin=0.5"], vocabularies=vocabulary)
    assert both.values[jaw] == 0.1 and both.values[PARAMETERS.index("mouthSmileRight")] == 1.0


def test_sizes_have_ends() -> None:
    assert parse_size("16x16384") == (16, 16384) and parse_size(" 32X16 ") == (32, 16)
    for wrong in ("15x16", "16x16385"):
        with pytest.raises(ParameterError):
            parse_size(wrong)
    assert Still.parse([], []).size == (800, 800)


def test_the_sheet_names_two_sides_of_angles_only() -> None:
    labels = [label for label, _ in sheet_poses()]
    assert {"headYaw +", "headYaw \N{MINUS SIGN}", "jawOpen"} <= set(labels)
    assert not {"headYaw", "jawOpen +", "jawOpen \N{MINUS SIGN}"} & set(labels)
    assert labels.index("happiness") < labels.index("jawOpen")


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Still).anything = 1


def test_heads_of_a_crowd_differ_and_keep_what_all_of_them_show() -> None:
    still = Still.parse(["cheekPuff=0.5"], [])
    poses = crowd_poses(still, 60)
    assert len({values.tobytes() for _, values in poses}) == 60
    assert [label for label, _ in poses[: len(still.vocabulary.names)]] == list(still.vocabulary.names)
    puff = PARAMETERS.index("cheekPuff")
    for _, values in poses:
        assert values[puff] >= 0.5 and (values >= PARAMETERS.low).all() and (values <= PARAMETERS.high).all()
    assert all((a == b).all() for (_, a), (_, b) in zip(poses, crowd_poses(still, 60), strict=True))


@pytest.mark.slow
def test_a_crowd_is_drawn_on_one_sheet(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    draw_crowd(Still.parse([], []), 3, tmp_path / "a.png", lambda *at: seen.append(at))
    page = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    assert seen == [(1, 3), (2, 3), (3, 3)]
    height, width = page.shape[0] // 2, page.shape[1] // 2
    tiles = [page[:height, :width], page[:height, width : 2 * width], page[height : 2 * height, :width]]
    assert all(np.abs(one - other).mean() > 3.0 for one, other in zip(tiles, tiles[1:] + tiles[:1], strict=True))


def test_a_crowd_is_not_posed_by_the_graphics_processor(tmp_path: Path) -> None:
    still = Still.parse([], [], look={"evaluator": "gpu"})
    with pytest.raises(ParameterError, match="posed by the CPU"):
        draw_crowd(still, 2, tmp_path / "a.png")
