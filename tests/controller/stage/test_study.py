"""Studies: orders, times, and what is wrong in a file."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.links.line.script import load_script
from controller.stage.study import load_study, write_script
from controller.tools.check import check_anything

STUDY = """
name = "smiles"
stage = "mine.toml"
seed = 3
repeats = 4
pause_s = 0.5
[conditions.smile]
steps = ["0 EXPR smile", "2 EXPR anger"]
length_s = 2.0
[conditions.still]
steps = ["0 NEUTRAL"]
length_s = 1.0
[conditions.jaw]
steps = ["0.5 SET jawOpen 1"]
length_s = 1.5
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "mine.toml").write_text('name = "mine"\n')
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "study.toml"


def order(path: Path, seed: int | None = None) -> list[str]:
    return [trial.condition for trial in load_study(path, P, seed).trials]


def test_the_same_seed_gives_the_same_order(path: Path) -> None:
    assert order(path) == order(path, 3) and len({tuple(order(path, seed)) for seed in range(20)}) > 10


def test_blocks_hold_every_condition_once(path: Path) -> None:
    found = order(path)
    assert all(sorted(found[n : n + 3]) == ["jaw", "smile", "still"] for n in range(0, 12, 3))


def test_other_orders(path: Path) -> None:
    path.write_text('order = "given"\n' + STUDY)
    assert order(path) == ["smile", "still", "jaw"] * 4
    path.write_text('order = "shuffled"\n' + STUDY)
    assert Counter(order(path)) == {"smile": 4, "still": 4, "jaw": 4}
    assert any(order(path, seed)[:3] != sorted({*order(path, seed)[:3]}) for seed in range(5))


def test_trials_follow_each_other_with_pauses_and_their_lines_lie_inside(path: Path) -> None:
    study = load_study(path, P)
    assert study.trials[0].begin_s == 1.0
    for one, other in zip(study.trials, study.trials[1:], strict=False):
        assert other.begin_s == pytest.approx(one.end_s + 0.5)
    assert study.length_s == pytest.approx(1.0 + 4 * 4.5 + 12 * 0.5)
    assert [at_s for at_s, _ in study.steps] == sorted(at_s for at_s, _ in study.steps)
    calm = [(at_s, line) for at_s, line in study.steps if line.startswith("NEUTRAL 0.4")]
    assert [at_s for at_s, _ in calm] == pytest.approx([trial.end_s for trial in study.trials])
    first = study.trials[0]
    assert study.marks[f"1:{first.condition}:begin"] == 1.0 and len(study.marks) == 24


def test_the_way_back_to_neutral_ends_before_the_next_trial(path: Path) -> None:
    path.write_text(STUDY.replace("pause_s = 0.5", "pause_s = 0.25"))
    assert sum(line == "NEUTRAL 0.25" for _, line in load_study(path, P).steps) == 12


def test_omote_check_knows_studies(path: Path) -> None:
    assert check_anything(str(path)) == ["study smiles: 12 trials of 3 conditions, 25 s: good"]


def test_a_study_is_a_script(path: Path, tmp_path: Path) -> None:
    study = load_study(path, P)
    write_script(study, tmp_path / "script.toml")
    script = load_script(str(tmp_path / "script.toml"), P)
    assert script.marks == study.marks and len(script.steps) == len(study.steps)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('steps = ["0 NEUTRAL"]', "", "conditions.still: give one of steps and script"),
        ('steps = ["0 NEUTRAL"]', 'steps = ["NEUTRAL"]', "conditions.still.steps[0]: begins with a time"),
        (
            'steps = ["0 NEUTRAL"]',
            'steps = ["0 NEUTRAL", "1.5 NEUTRAL"]',
            "conditions.still.steps[1]: comes after the condition's length_s = 1 (is '1.5 NEUTRAL')",
        ),
        ('steps = ["0 NEUTRAL"]', 'script = "toor"', "did you mean 'tour'"),
        ("length_s = 1.0", "length_s = 0", "conditions.still.length_s"),
        ("repeats = 4", "repeats = 1000", "3000 trials are more than 2000"),
        ("conditions.still", "conditions.'two words'", "conditions.two words"),
        ('stage = "mine.toml"', "", "stage: missing"),
    ],
)
def test_what_is_wrong_is_told(path: Path, old: str, new: str, told: str) -> None:
    path.write_text(STUDY.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load_study(path, P)
    assert told in str(caught.value)


def test_every_line_that_is_none_is_told_with_its_place(path: Path) -> None:
    """Before a folder for it is made, and by omote check as well."""
    path.write_text(STUDY.replace("0 EXPR smile", "0 EXPR smil").replace("0 NEUTRAL", "NEUTRAL"))
    for read in (lambda: load_study(path, P), lambda: check_anything(str(path))):
        with pytest.raises(ConfigError) as caught:
            read()
        told = str(caught.value)
        assert "conditions.smile.steps[0]: unknown expression 'smil', did you mean 'smile'" in told
        assert "conditions.still.steps[0]: begins with a time in seconds, then the line (is 'NEUTRAL')" in told


def test_expressions_of_the_stage_are_known(path: Path) -> None:
    (path.parent / "mine.toml").write_text('name = "mine"\nvocabularies = ["own.toml"]\n')
    (path.parent / "own.toml").write_text("[beam]\nweights = { mouthSmileLeft = 1.0 }\n")
    path.write_text(STUDY.replace("0 EXPR smile", "0 EXPR beam"))
    assert any(line == "EXPR beam" for _, line in load_study(path, P).steps)


def test_more_lines_than_a_script_holds_are_refused(path: Path) -> None:
    lines = ", ".join(f'"{n / 1000} PING"' for n in range(900))
    path.write_text(STUDY.replace('"0 NEUTRAL"', lines).replace("repeats = 4", "repeats = 100"))
    with pytest.raises(ConfigError, match="lines in all are more than 50000"):
        load_study(path, P)
