"""surface.fit.measures.refusal: a head with faults is written beside its place, and what was there stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cards import card
from small_head import small_head

from surface.base.errors import FitError
from surface.fit.measures.refusal import refused_folder, save_or_refuse
from surface.head import Head
from surface.head.model.accessories import read_accessories
from surface.head.posing.fit_error import read_fit_error


def test_a_head_without_faults_is_written_to_its_place(tmp_path: Path) -> None:
    save_or_refuse(tmp_path / "mine", small_head(), [], {})
    assert Head.load(tmp_path / "mine").parts
    assert not refused_folder(tmp_path / "mine").exists()


def test_a_refused_head_lies_beside_its_place_and_says_where(tmp_path: Path) -> None:
    place = tmp_path / "mine"
    save_or_refuse(place, small_head(), [], {})
    before = {path.name: path.read_bytes() for path in place.iterdir()}
    with pytest.raises(FitError, match=r"spike of 9 mm; a hole; it was written to .*mine-refused instead") as caught:
        save_or_refuse(place, small_head(), ["spike of 9 mm", "a hole"], {}, hint="mend the mesh")
    assert {path.name: path.read_bytes() for path in place.iterdir()} == before
    assert Head.load(refused_folder(place)).parts
    assert "mend the mesh" in (caught.value.hint or "") and "--force" in (caught.value.hint or "")


def test_who_insists_gets_the_head_in_its_place_with_its_errors(tmp_path: Path) -> None:
    place, data = tmp_path / "mine", small_head()
    errors = {"a": np.full(len(Head(data).part("a").vertices), 0.25)}
    save_or_refuse(place, data, ["a hole"], errors, force=True)
    assert read_fit_error(place, Head.load(place).parts)["a"].tolist() == pytest.approx(errors["a"].tolist())
    assert not refused_folder(place).exists()
    save_or_refuse(place, data, [], {})
    assert read_fit_error(place, Head.load(place).parts) == {}, "those of the head before are gone"


def test_accessories_are_kept_beside_the_head_until_another_one_is_written(tmp_path: Path) -> None:
    save_or_refuse(tmp_path, small_head(), [], {}, [card()])
    assert [one.name for one in read_accessories(tmp_path)] == ["Card"]
    save_or_refuse(tmp_path, small_head(), [], {})
    assert read_accessories(tmp_path) == ()
