"""Persons: the shipped ones, a user's own, mixtures, and what is told of faults."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.base.paths import config_dir
from controller.face.still import Still
from controller.stage.persons import (
    PersonSettings,
    find_style,
    linear,
    mixed_identity,
    mixed_look,
    parse_person,
    read_persons,
)
from controller.stage.stage import load_stage
from controller.tools.check import check_anything

PERSONS = sorted(path.stem for path in (config_dir() / "persons").glob("*.toml"))


def test_there_are_eight() -> None:
    assert len(PERSONS) == 8


@pytest.mark.parametrize("name", PERSONS)
def test_each_is_good(name: str) -> None:
    assert check_anything(name)[0].startswith(f"person {name}: ")


def test_a_mixture_is_between_its_persons() -> None:
    pair = read_persons({"birch": 1.0, "ebony": 1.0})
    (birch, half), (ebony, _) = pair
    look = mixed_look(pair)
    assert half == 0.5 and look is not None and look.melanin is not None
    assert look.melanin == pytest.approx((birch.settings.skin.melanin + ebony.settings.skin.melanin) / 2)
    own, other = linear(birch.settings.eyes.iris), linear(ebony.settings.eyes.iris)
    assert own is not None and other is not None
    assert look.iris == pytest.approx([(a + b) / 2 for a, b in zip(own, other, strict=True)])
    fine = (birch.settings.identity["fine"] + ebony.settings.identity["fine"]) / 2
    assert mixed_identity(pair, {"young": 1.0}) | {} == pytest.approx(
        {"fine": fine, "young": 1.0, "long": ebony.settings.identity["long"] / 2}
    )
    assert mixed_look([]) is None


def test_colours_are_decoded() -> None:
    assert linear("#ffffff") == pytest.approx((1, 1, 1)) and linear(None) is None
    assert linear("#bc0a00") == pytest.approx((0.5028865, 0.00303527, 0.0))  # of the table in IEC 61966-2-1


def test_a_command_line_names_one_or_several() -> None:
    assert parse_person(None) is None and parse_person("maple") == "maple"
    assert parse_person("maple=0.5, oak=0.25") == {"maple": 0.5, "oak": 0.25}
    for text in ("maple=x", "maple=2", "=1"):
        with pytest.raises(ParameterError, match="--person"):
            parse_person(text)


def test_a_persons_own_file_beside_the_stage(tmp_path: Path) -> None:
    (tmp_path / "me.toml").write_text('name = "me"\n[identity]\nlong = 1.0\n[skin]\nmelanin = 0.5\n')
    (tmp_path / "mine.toml").write_text('name = "mine"\n[face]\nperson = { "me.toml" = 1.0 }\n')
    stage = load_stage(str(tmp_path / "mine.toml"), PARAMETERS)
    assert [person.settings.name for person, _ in stage.persons] == ["me"]
    assert Still.parse([], [], stage=str(tmp_path / "mine.toml")).persons == stage.persons


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('name = "x"\n[skin]\nmelanine = 1\n', "skin.melanine: unknown key, did you mean 'melanin'?"),
        ('name = "x"\n[skin]\nmelanin = 2\n', "skin.melanin: input should be less than or equal to 1 (is 2)"),
        (
            'name = "x"\n[skin]\nforehead = [1, 3, 0]\n',
            "skin.forehead[1]: input should be less than or equal to 2 (is 3)",
        ),
        ('name = "x"\n[eyes]\niris = "blue"\n', "eyes.iris: "),
        (f'name = "x"\n[hair]\nstyle = "{300 * "x"}"\n', "no hair 'xxx"),
        ('name = "x"\n[hair]\nstyle = "shrot"\n', "no hair 'shrot', did you mean 'short'? (there are afro, bun, crop"),
        ('name = "x"\n[identity]\nround = 1.0\n', "no identity 'round'; there are broad"),
    ],
)
def test_faults_are_told(tmp_path: Path, text: str, fault: str) -> None:
    (tmp_path / "x.toml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        check_anything(str(tmp_path / "x.toml"))
    assert fault in str(caught.value)
    (tmp_path / "mine.toml").write_text('name = "mine"\n[face]\nperson = "x.toml"\n')
    with pytest.raises(ConfigError, match=r"face\.person"):
        load_stage(str(tmp_path / "mine.toml"), PARAMETERS)


def test_nobody_of_that_name() -> None:
    with pytest.raises(ConfigError, match="no person 'mapel', did you mean 'maple'"):
        Still.parse([], [], look={"person": "mapel"})


def test_a_person_of_whom_nothing_is_said_has_a_usual_skin_and_wears_nothing() -> None:
    look = PersonSettings(name="anybody").look()
    assert (look.melanin, look.blood, look.redness, look.freckles, look.age) == (0.2, 0.0, 1.0, 0.0, 0.0)
    assert look.forehead == (1.0, 1.0, 1.0)
    assert (look.lips, look.iris, look.brow, look.brow_strength, look.worn) == (None, None, None, 1.0, ())


def test_a_style_beside_the_file_comes_before_one_of_the_working_folder_and_that_before_a_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert find_style("hair", "short") == config_dir() / "wardrobe" / "hair-short.npz"
    (tmp_path / "here" / "short").touch()
    assert find_style("hair", "short", tmp_path / "me.toml") == Path("short")
    (tmp_path / "short").touch()
    assert find_style("hair", "short", tmp_path / "me.toml") == tmp_path / "short"
    assert find_style("hair", "short") == Path("short")
    with pytest.raises(ConfigError, match=r"hair\.style: no hair 'shrot', did you mean 'short'\?$"):
        find_style("hair", "shrot")
    with pytest.raises(ConfigError, match=r"hair\.style: no hair 'qqqqqq'$"):
        find_style("hair", "qqqqqq")
