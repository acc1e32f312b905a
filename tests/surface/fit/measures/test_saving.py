"""surface.fit.measures.saving: no head gets what belonged to the one before, and that one loses nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cards import card
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.fit.measures import saving
from surface.fit.measures.saving import ASIDE, save_head
from surface.head import Head
from surface.head.model.accessories import FILE, read_accessories
from surface.head.model.texture import FILE as TEXTURE
from surface.head.model.texture import HeadTexture
from surface.head.posing.fit_error import FIT_ERROR

SKIN = HeadTexture(b"\x89PNG", (0.5, 0.5, 0.5), {})


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a head that wears a card, has a texture and knows how far it is from its mesh."""
    data = small_head()
    save_head(tmp_path, data, {"a": np.zeros(len(Head(data).part("a").vertices))}, [card()], SKIN)
    return tmp_path


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_a_new_head_has_only_its_own(place: Path) -> None:
    assert set(files(place)) == {"head.toml", "head.npz", FIT_ERROR, FILE, TEXTURE}
    save_head(place, small_head(), {}, [replace(card(), name="Other")])
    assert [one.name for one in read_accessories(place)] == ["Other"]
    (place / (FILE + ASIDE)).write_bytes(b"of one that was killed")
    save_head(place, small_head())
    assert set(files(place)) == {"head.toml", "head.npz"}


@pytest.mark.parametrize("error", [HeadFileError("the disk is full"), KeyboardInterrupt()])
def test_the_old_head_keeps_everything_if_the_new_one_cannot_be_written(
    place: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    before = files(place)
    seen = list[set[str]]()

    def fail(*_: Any) -> None:
        seen.append(set(files(place)))
        raise error

    monkeypatch.setattr(saving, "save_data", fail)
    with pytest.raises(type(error)):
        save_head(place, small_head(), {}, [])
    assert files(place) == before
    aside = {file + ASIDE for file in (FIT_ERROR, FILE, TEXTURE)}
    assert seen == [{"head.toml", "head.npz", *aside}], "killed here, nothing is lost or mixed"


@pytest.mark.parametrize("name", ["write_fit_error", "write_accessories"])
def test_the_new_head_does_not_get_the_old_ones_hair_if_its_own_cannot_be_written(
    place: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def fail(*_: Any) -> None:
        raise HeadFileError("the disk is full")

    monkeypatch.setattr(saving, name, fail)
    with pytest.raises(HeadFileError, match="the disk is full"):
        save_head(place, small_head(name="new"), {}, [card()])
    assert Head.load(place).name == "new" and read_accessories(place) == ()


@pytest.mark.parametrize("blocked", [FIT_ERROR + ASIDE, FILE + ASIDE])
def test_what_cannot_be_put_aside_is_told_and_nothing_changes(place: Path, blocked: str) -> None:
    (place / blocked).mkdir()
    (place / blocked / "something").touch()
    before = files(place)
    with pytest.raises(HeadFileError, match="cannot be replaced") as caught:
        save_head(place, small_head(name="new"))
    assert caught.value.hint and files(place) == before
