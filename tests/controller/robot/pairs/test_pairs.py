"""omote calibrate --pairs: known mixes come back from pairs that they made; what is not determined is said."""

from __future__ import annotations

import re
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS as P
from controller.cli.app import make_app
from controller.robot.channels import build_table
from controller.robot.pairs.files import fit_channels, read_pairs, write_robot
from controller.robot.pairs.fit import fit_servo
from controller.robot.robot import load_robot
from tests.controller.robot.small_robot import robot_text

JAW, SMILE, FROWN, BLINK = (P.index(n) for n in ("jawOpen", "mouthSmileLeft", "mouthFrownLeft", "eyeBlinkLeft"))
ROBOT = (
    robot_text("one")
    + """
# the jaw's own servo
[[channels]]
name = "jaw"
id = 1
profile = "servo"
mix = { jawOpen = 1 }

[[channels]]
name = "corner"
id = 2
profile = "servo"
mix = { mouthSmileLeft = 1 }

[[channels]]
name = "still"
id = 3
profile = "servo"
mix = { eyeBlinkLeft = 1 }
"""
)


def faces(count: int = 240, seed: int = 1) -> np.ndarray:
    """(count, p) smooth motion of four parameters, as a recording has."""
    rng, t = np.random.default_rng(seed), np.arange(count) / 30
    values = np.zeros((count, len(P)))
    for at in (JAW, SMILE, FROWN, BLINK):
        values[:, at] = 0.5 + 0.5 * np.sin(t * rng.uniform(1.0, 4.0) + rng.uniform(0, 6))
    return values


def true_jaw(values: np.ndarray) -> np.ndarray:
    return np.asarray(-8.0 + np.interp(values[:, JAW], [0, 0.25, 0.5, 0.75, 1], [0, 2, 6, 16, 40]))


def true_corner(values: np.ndarray) -> np.ndarray:
    return np.asarray(3.0 + 25.0 * values[:, SMILE] - 12.0 * values[:, FROWN])


def test_weights_come_back() -> None:
    values = faces()
    fit = fit_servo(values, true_corner(values))
    terms = {term.parameter: float(term.gives[-1] - term.gives[0]) for term in fit.terms}
    assert set(terms) == {SMILE, FROWN}
    assert terms[SMILE] == pytest.approx(25.0, abs=0.5)
    assert terms[FROWN] == pytest.approx(-12.0, abs=0.5)
    assert fit.left_out_deg < 0.3 and not fit.why_not


def test_a_curve_comes_back_monotone_and_predicts_other_faces() -> None:
    values = faces()
    fit = fit_servo(values, true_jaw(values) + np.random.default_rng(3).normal(scale=0.2, size=len(values)))
    (term,) = fit.terms
    assert term.parameter == JAW and len(term.at) == 5
    assert (np.diff(term.gives) >= 0.0).all()
    other = faces(seed=9)
    assert np.sqrt(((fit.angles(other) - true_jaw(other)) ** 2).mean()) < 0.6
    assert fit.left_out_deg < 1.0


def test_what_the_pairs_do_not_determine_is_said() -> None:
    values = faces()
    assert fit_servo(values, np.full(len(values), 4.0)).why_not == "it does not move in the pairs"
    noise = np.random.default_rng(4).normal(scale=10.0, size=len(values))
    assert "what was left out is only predicted to" in fit_servo(values, noise).why_not
    values[:, FROWN] = values[:, SMILE]
    alike = {frozenset(pair) for pair in fit_servo(values, 10.0 * values[:, SMILE]).alike}
    assert alike == {frozenset({SMILE, FROWN})}
    with pytest.raises(ValueError, match="needs 20 pairs or more"):
        fit_servo(values[:10], np.zeros(10))


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "robot.toml").write_text(ROBOT)
    values = faces()
    names = [P.names[i] for i in (JAW, SMILE, FROWN, BLINK)]
    rows = np.column_stack([np.arange(len(values)) / 30, values[:, [JAW, SMILE, FROWN, BLINK]], true_jaw(values),
                            true_corner(values), np.zeros(len(values))])  # fmt: skip
    head = ",".join(["time", *names, "servos:jaw", "servos:corner", "servos:still"])
    np.savetxt(tmp_path / "pairs.csv", rows, fmt="%.5f", delimiter=",", header=head, comments="")
    return tmp_path / "robot.toml", tmp_path / "pairs.csv"


def test_the_command_writes_the_channels_and_keeps_the_old_file(files: tuple[Path, Path]) -> None:
    robot, pairs = files
    result = CliRunner().invoke(make_app(), ["calibrate", str(robot), "--pairs", str(pairs)])
    assert result.exit_code == 0, result.output
    assert robot.with_name("robot.before1.toml").read_text() == ROBOT
    assert "it does not move in the pairs" in " ".join(result.output.split())
    table, values = build_table(load_robot(robot, P).channels, P), faces(seed=7)
    angles = np.degrees([table.angles(row)[0] for row in values])
    assert np.sqrt(((angles[:, 0] - true_jaw(values)) ** 2).mean()) < 1.0
    assert np.sqrt(((angles[:, 1] - true_corner(values)) ** 2).mean()) < 0.5
    assert load_robot(robot, P).channels[2].mix == load_robot(robot.with_name("robot.before1.toml"), P).channels[2].mix
    CliRunner().invoke(make_app(), ["calibrate", str(robot), "--pairs", str(pairs)])
    assert robot.with_name("robot.before2.toml").exists()


def test_parameters_of_the_robot_s_own_are_fitted_too(files: tuple[Path, Path], tmp_path: Path) -> None:
    robot, pairs = files
    (tmp_path / "ears.toml").write_text('[parameters.earLeft]\nregion = "mouth"\nprofile = "mouth"\n')
    robot.write_text('vocabularies = ["ears.toml"]\n' + ROBOT)
    pairs.write_text(pairs.read_text().replace("jawOpen", "earLeft", 1))
    result = CliRunner().invoke(make_app(), ["calibrate", str(robot), "--pairs", str(pairs)])
    assert result.exit_code == 0, result.output
    jaw, corner, _ = load_robot(robot, P).channels
    assert set(jaw.mix or {}) == {"earLeft"}
    assert set(corner.mix or {}) == {"mouthSmileLeft", "mouthFrownLeft"}


def test_a_place_that_cannot_be_written_is_one_message_and_leaves_nothing(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    robot, pairs = files
    before = sorted(tmp_path.iterdir())
    words = ["calibrate", str(robot), "--pairs", str(pairs), "-o"]
    error = CliRunner().invoke(make_app(), [*words, str(pairs / "o.toml")]).exception
    assert isinstance(error, ControllerError) and "pairs.csv/o.toml: cannot be written" in str(error)
    robot.write_text(ROBOT.replace("limit_deg", "limits_deg"))
    assert CliRunner().invoke(make_app(), [*words, str(tmp_path / "o.toml")]).exit_code == 1
    assert sorted(tmp_path.iterdir()) == before


def test_limits_of_the_file_stay(files: tuple[Path, Path]) -> None:
    robot, pairs = files
    robot.write_text(ROBOT.replace("limit_deg = [-45, 45]", "limit_deg = [-20, 20]").replace("[-40, 40]", "[-20, 20]"))
    settings = load_robot(robot, P)
    fitted = fit_channels(settings, read_pairs(pairs, settings, P))
    write_robot(robot, robot, fitted, P)
    table = build_table(load_robot(robot, P).channels, P)
    angles = np.degrees([table.angles(row)[0] for row in faces()])
    assert np.abs(angles).max() <= 20.0 + 1e-9


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda text: text.replace("servos:jaw", "servos:jaws"), "the robot has no channel of that name"),
        (lambda text: text.replace("jawOpen", "jawOpn"), "is no parameter, and no servos:NAME"),
        (lambda text: "\n".join(text.splitlines()[:9]), "has 8 pairs; it takes 20"),
        (lambda text: text.replace("0.03333", "x", 1), "row 3: has 7 numbers for 8 columns"),
        (lambda text: "jawOpen\n" + "0.5\n" * 30, "there is no column servos:NAME"),
        (lambda text: re.sub("0.03333,[^,]*", "0.03333,1e308", text), "row 3: jawOpen is 1e+308, beyond 0 to 1"),
        (lambda text: re.sub("0.03333,[^,]*", "0.03333,1.06", text), "row 3: jawOpen is 1.06, beyond 0 to 1"),
        (lambda text: text[:-8] + "1e300\n", "row 241: servos:still is 1e+300, beyond -36000 to 36000, degrees"),
    ],
)
def test_a_wrong_table_says_what_is_wrong(files: tuple[Path, Path], change: Any, fault: str) -> None:
    robot, pairs = files
    pairs.write_text(change(pairs.read_text()))
    with pytest.raises(ConfigError) as caught:
        read_pairs(pairs, load_robot(robot, P), P)
    assert fault in str(caught.value)


@pytest.mark.parametrize(("count", "enough"), [(19, False), (20, True)])
def test_twenty_pairs_are_enough_to_be_read(files: tuple[Path, Path], count: int, enough: bool) -> None:
    robot, pairs = files
    pairs.write_text("\n".join(pairs.read_text().splitlines()[: count + 1]))
    if enough:
        assert len(read_pairs(pairs, load_robot(robot, P), P).values) == count
    else:
        with pytest.raises(ConfigError, match="has 19 pairs"):
            read_pairs(pairs, load_robot(robot, P), P)


def test_two_spellings_of_one_parameter_and_a_hundred_thousand_columns_are_refused_at_once(tmp_path: Path) -> None:
    robot, pairs = tmp_path / "one.toml", tmp_path / "pairs.csv"
    robot.write_text(ROBOT)
    settings = load_robot(robot, P)
    pairs.write_text("mouthSmileLeft,mouthSmile_L,servos:jaw\n" + "0,1,2\n" * 100)
    with pytest.raises(ConfigError, match="column 'mouthSmile_L': is the same parameter as column 'mouthSmileLeft'"):
        read_pairs(pairs, settings, P)
    pairs.write_text(",".join(f"a{i}" for i in range(100_000)) + "\n1,2\n")
    begin_s = process_time()
    with pytest.raises(ConfigError, match="column 'a0': is no parameter"):
        read_pairs(pairs, settings, P)
    assert process_time() - begin_s < 10.0
