"""surface.fit.surfaces.pieces: what is read of a file of surfaces, and what is left out by name or by an error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from surface import DCPSurface, SurfaceFileError
from surface.base.errors import FitError
from surface.fit.surfaces import pieces as module
from surface.fit.surfaces.pieces import read_pieces
from surface.readers import NamedSurface


def sheet(at: float) -> DCPSurface:
    knots = [0.0, 0.0, 1.0, 1.0]
    net = np.array([[[at + i, j, 0.1 * i * j] for j in range(2)] for i in range(2)], float)
    return DCPSurface.from_nurbs(1, 1, knots, knots, net, np.ones((2, 2)))


@pytest.fixture
def damaged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of two surfaces and of one that cannot be read, which is left out where somebody takes its error."""

    def read(path: str | Path, leave_out: Callable[[SurfaceFileError], Any] | None) -> list[NamedSurface]:
        error = SurfaceFileError(f"{path}: object 3: a subdivision surface")
        if leave_out is None:
            raise error
        leave_out(error)
        return [NamedSurface("cheek", sheet(0.0)), NamedSurface("brow", sheet(2.0))]

    monkeypatch.setattr(module, "read_surface", read)


@pytest.mark.usefixtures("damaged")
def test_what_cannot_be_read_is_left_out_by_name_unless_everything_shall_be() -> None:
    found, notes = read_pieces("a.3dm")
    assert [piece.name for piece in found] == ["cheek", "brow"]
    assert "left out, cannot be read: a.3dm: object 3: a subdivision surface" in notes
    with pytest.raises(SurfaceFileError, match="object 3"):
        read_pieces("a.3dm", strict=True)


@pytest.mark.usefixtures("damaged")
def test_names_choose_surfaces_and_a_name_of_none_is_refused() -> None:
    assert [piece.name for piece in read_pieces("a.3dm", without=["brow"])[0]] == ["cheek"]
    assert [piece.name for piece in read_pieces("a.3dm", only=["BROW"])[0]] == ["brow"]
    with pytest.raises(FitError, match="nose"):
        read_pieces("a.3dm", only=["nose"])
