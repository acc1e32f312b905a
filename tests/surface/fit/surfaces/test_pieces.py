"""surface.fit.surfaces.pieces: what is read of a file of surfaces, and what is left out by name or by an error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from surface import DCPSurface, SurfaceFileError
from surface.base.errors import FitError
from surface.fit.source.mesh import LARGE, SMALL
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


def named(*names: str) -> list[NamedSurface]:
    return [NamedSurface(name, sheet(2.0 * k)) for k, name in enumerate(names)]


def test_a_word_means_the_surfaces_of_that_name_or_else_those_that_hold_it() -> None:
    items = named("Eye", "eyelid left", "Eyelid right", "chin")
    assert module._named(items, "EYE", "--only", "f") == {0}
    assert module._named(items, "lid", "--only", "f") == {1, 2}
    with pytest.raises(FitError, match=r"^--only ear: f holds 'Eye', 'eyelid left', 'Eyelid right', 'chin'"):
        module._named(items, "ear", "--only", "f")
    kept = module._chosen(items, ["left"], ["lid", "chin"], "f")
    assert [item.name for item in kept] == ["Eyelid right", "chin"]
    with pytest.raises(FitError, match="f: nothing is left of it"):
        module._chosen(items, ["e", "chin"], [], "f")


def test_clothes_are_left_out_and_said_unless_nothing_would_remain() -> None:
    items = named("Head", "Shirt", "Jacket", "Hat")
    kept, notes = module._own(items)
    assert [item.name for item in kept] == ["Head"]
    assert notes == [
        "clothes left out: 'Shirt', 'Jacket' (--only NAME keeps it)", "hat left out: 'Hat' (--only NAME keeps it)",
    ]  # fmt: skip
    assert module._own(items[1:]) == (items[1:], [])


def test_names_are_unique_and_hold_no_slash() -> None:
    found = module.make_pieces(named("a/b", "a b", "a b", " ", "", "a b 2"), "f")
    assert [piece.name for piece in found] == ["a b", "a b 2", "a b 3", "surface", "surface 2", "a b 2 2"]
    assert [piece.title for piece in found] == ["a/b", "a b", "a b", " ", "", "a b 2"]
    size = max(float(np.ptp(piece.surface.points, axis=0).max()) for piece in found)
    assert all(piece.chord == pytest.approx(1.5e-3 * size) for piece in found)
    front = module.with_face(module.make_pieces(named("face", "nose", "face"), "f"), 1)
    assert [piece.name for piece in front] == ["face", "face 2", "face 2"]
    assert front[0].title == "nose"


def test_samples_of_all_pieces_are_joined() -> None:
    pieces = module.make_pieces(named("a", "b"), "f")
    points, triangles = module.joined(pieces)
    first = len(pieces[0].mesh.vertices)
    np.testing.assert_array_equal(points, np.concatenate([piece.mesh.vertices for piece in pieces]))
    np.testing.assert_array_equal(triangles[: len(pieces[0].mesh.triangles)], pieces[0].mesh.triangles)
    np.testing.assert_array_equal(triangles[len(pieces[0].mesh.triangles) :], pieces[1].mesh.triangles + first)
    assert triangles.dtype == np.int64


@pytest.mark.parametrize(("scale", "shift", "fits"), [
    (1.0, 0.0, True), (SMALL * 1.01, 0.0, True), (SMALL, 0.0, False), (LARGE, 0.0, True), (LARGE * 1.01, 0.0, False),
    (1.0, LARGE - 1.0, True), (1.0, LARGE * 1.001, False),
])  # fmt: skip
def test_surfaces_of_a_size_or_place_that_no_head_has_are_refused(scale: float, shift: float, fits: bool) -> None:
    item = NamedSurface("a", sheet(0.0))
    moved = item.surface.with_points(scale * item.surface.points + [shift, 0.0, 0.0])
    if fits:
        assert len(module.make_pieces([NamedSurface("a", moved)], "f")) == 1
    else:
        with pytest.raises(FitError, match="f: its control points span"):
            module.make_pieces([NamedSurface("a", moved)], "f")
    with pytest.raises(FitError, match="f: holds no surface"):
        module.make_pieces([], "f")
