"""What is carried to the parameters of another stage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS, Parameters
from controller.panels.session.commands import History, Settings
from controller.panels.session.next_run import NextRun, carried_to
from controller.takes.livelink import Take

NAMES = ("jawOpen", "hers", "cheekPuff")
"""The parameters of the stage before: the second is one that this stage lacks."""
JAW, PUFF = PARAMETERS.index("jawOpen"), PARAMETERS.index("cheekPuff")


def take() -> Take:
    values = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    return Take("a", np.array([0.0, 1.0]), values, np.array([True, True, False]), np.zeros(3), np.ones(3))


def carried(history: History | None, **held: float) -> History | None:
    return carried_to(NextRun(Path("a.toml"), (), history, NAMES, held), PARAMETERS)


def test_without_anything_to_carry_a_run_begins_again() -> None:
    assert carried(None, jawOpen=0.5) is None


def test_held_parameters_go_by_name_and_those_that_are_missing_are_left_out() -> None:
    every = [Settings(held={0: 0.1 * k, 1: 0.2, 2: 0.3}) for k in (1, 2, 3)]
    found = carried(History(every[0], (every[1],), (every[2],)))
    assert found is not None
    for settings, jaw in ((found.now, 0.1), (found.past[0], 0.2), (found.future[0], 0.3)):
        assert dict(settings.held) == {JAW: pytest.approx(jaw), PUFF: 0.3}


def test_what_is_held_besides_is_held_now_and_counts_more() -> None:
    settings = Settings(held={0: 0.1}, life=0.7)
    found = carried(History(settings, (settings,)), jawOpen=0.9, tongueOut=0.4)
    assert found is not None and found.now.life == 0.7
    assert found.now.held == {JAW: 0.9, PARAMETERS.index("tongueOut"): 0.4} and found.past[0].held == {JAW: 0.1}


def test_a_recording_goes_by_name_and_the_rest_of_the_face_is_neutral() -> None:
    found = carried(History(Settings(take=take())))
    assert found is not None and found.now.take is not None
    got: Take = found.now.take
    assert got.values.shape == (2, len(PARAMETERS)) and np.flatnonzero(got.mask).tolist() == [JAW]
    wanted = np.tile(PARAMETERS.neutral(), (2, 1))
    wanted[:, JAW], wanted[:, PUFF] = (0.1, 0.4), (0.3, 0.6)
    np.testing.assert_array_equal(got.values, wanted)
    assert not got.values.flags.writeable and not got.mask.flags.writeable
    at = got.sample(0.5, PARAMETERS.neutral())
    assert at[JAW] == pytest.approx(0.25) and at[PARAMETERS.index("tongueOut")] == 0.0
    none = carried(History(Settings()))
    assert none is not None and none.now.take is None


def test_parameters_of_more_vocabularies_keep_what_was_held(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('[parameters.hers]\nregion = "mouth"\nprofile = "mouth"\nrange = [0.0, 1.0]\n')
    more: Parameters = PARAMETERS.with_files([path])
    found = carried_to(NextRun(Path("a.toml"), (path,), History(Settings(held={1: 0.2})), NAMES), more)
    assert found is not None and found.now.held == {more.index("hers"): 0.2}
