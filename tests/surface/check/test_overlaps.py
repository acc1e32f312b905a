"""Skin that passes through itself, an eyeball or teeth by depths that are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface.check import overlaps as module
from surface.check.overlaps import Overlap, overlap_notes, overlapping, overlaps
from surface.check.places import Places
from tests.surface.check import plain


def skin(z: float = 0.0, **options: Any) -> SimpleNamespace:
    """A sheet of skin that faces +z at a height."""
    points, triangles = plain.sheet((-30, 30), (-100, 60), 2.0, z)
    return plain.part("face", points, triangles, **options)


def ball(height: float, radius: float = 12.0, *, material: str = "teeth", y: float = -60.0, **options: Any) -> Any:
    """A ball whose top lies at a height."""
    points, triangles, normals = plain.ball((0.0, y, height - radius), radius)
    return plain.part("ball", points, triangles, material=material, normals=normals, **options)


def measured(*parts: Any, **options: Any) -> dict[str, Overlap]:
    subject = plain.subject(*parts, **options)
    return {one.material: one for one in overlaps(subject, Places(subject, None))}


def test_the_depth_is_how_far_skin_lies_behind_what_it_passed() -> None:
    """Vertices near the middle lie no deeper than the ball is high, and ten square millimetres of them nearly so."""
    found = measured(skin(), ball(1.5))
    assert list(found) == ["teeth"]
    assert 1.2 < found["teeth"].mm < 1.6 and found["teeth"].shape == ""
    assert found["teeth"].limit == module.LIMITS_MM["teeth"] == 2.0
    assert found["teeth"].mm < measured(skin(), ball(3.0))["teeth"].mm < measured(skin(), ball(6.0))["teeth"].mm


def test_what_does_not_reach_the_skin_passes_through_nothing() -> None:
    assert measured(skin(), ball(-0.5)) == {} and measured(skin()) == {} and measured(ball(3.0)) == {}


def test_other_materials_may_lie_where_they_like() -> None:
    for material in ("tongue", "gums", "hair", "lash"):
        assert measured(skin(), ball(3.0, material=material)) == {}


@pytest.mark.parametrize(("radius", "named"), [(2.0, False), (4.0, True)])
def test_an_overlap_has_the_area_of_a_few_vertices(radius: float, named: bool) -> None:
    """10 mm²: of a sheet with 2 mm between its vertices, three of them."""
    assert bool(measured(skin(), ball(1.5, radius))) == named


def pushed(name: str, by: float) -> dict[str, np.ndarray]:
    points, _ = plain.sheet((-30, 30), (-100, 60), 2.0)
    return {name: np.tile([0.0, 0.0, -by], (len(points), 1))}


def test_the_deepest_shape_counts_and_teeth_only_with_an_open_jaw() -> None:
    moves = pushed("cheekPuff", 5.0) | pushed("jawOpen", 3.5)
    found = measured(skin(moves=moves), ball(-2.0, material="eye"), ball(-1.0, y=-20.0))
    assert (found["eye"].shape, found["teeth"].shape) == ("cheekPuff", "jawOpen")
    assert found["eye"].mm == pytest.approx(3.0, abs=0.3) and found["teeth"].mm == pytest.approx(2.5, abs=0.3)
    assert found["eye"].limit == 2.0


def test_skin_that_folds_into_itself_is_a_warning_and_teeth_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LIMITS_MM", {"skin": 0.5, "teeth": 2.0})
    other = ball(6.0, material="skin")
    subject = plain.subject(skin(), other, ball(4.0, y=0.0))
    found = list(overlapping(subject, Places(subject, None)))
    assert [f.warning for f in found] == [True, False]  # the deepest relative to its limit first
    assert all(f.kind == "overlap" and "mm at most" in f.text for f in found)
    assert "itself" in found[0].text and "the teeth" in found[1].text


@pytest.mark.parametrize(("beyond", "named"), [(0.01, True), (-0.01, False)])
def test_only_what_is_deeper_than_its_limit_is_a_finding(
    beyond: float, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject = plain.subject(skin(), ball(3.0))
    deep = measured(skin(), ball(3.0))["teeth"].mm
    monkeypatch.setattr(module, "LIMITS_MM", {"skin": 4.0, "teeth": deep - beyond})
    assert bool(list(overlapping(subject, Places(subject, None)))) == named


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_limits_grow_with_the_head(scale: float) -> None:
    parts = [skin(), ball(3.0)]
    for part in parts:
        part.rest *= np.float32(scale)
        part.vertices *= np.float32(scale)
    one = measured(*parts, eyes=scale * plain.EYES)["teeth"]
    usual = measured(skin(), ball(3.0))["teeth"]
    assert one.mm == pytest.approx(scale * usual.mm, rel=1e-3) and one.limit == pytest.approx(2.0 * scale)


def test_skin_that_nobody_sees_at_rest_may_overlap_teeth() -> None:
    """What lines the mouth lies in a closed box of skin."""
    lining, inside = skin(-40.0), ball(-37.0)
    points, triangles, normals = plain.ball((0.0, -20.0, -40.0), 150.0)
    hull = plain.part("hull", points, triangles, normals=normals)
    assert measured(lining, inside)["teeth"].mm > 2.0
    assert measured(hull, lining, inside) == {}


def test_flesh_ends_at_what_lines_the_mouth() -> None:
    """A lip that reaches a millimetre into the other, up to the other's lining, is no deeper in it than that."""
    deep = measured(skin(), ball(6.0, material="skin"))["skin"].mm
    points, triangles = plain.sheet((-20, 20), (-80, -40), 2.0)
    above = plain.part("above", points + np.array([0.0, 0.0, 1.0]), triangles, material="mouth")  # within the ball
    below = plain.part(
        "below", points - np.array([0.0, 0.0, 1.0]), triangles[:, ::-1], material="mouth"
    )  # of the sheet
    shallow = measured(skin(), ball(6.0, material="skin"), above, below)["skin"].mm
    assert deep > 3.0 and 0.6 < shallow < 2.1
    assert measured(skin(), above, below) == {}


@pytest.mark.parametrize(("back", "counts"), [(2.0, True), (-9.0, False)])
def test_what_lines_the_lids_may_fold_inside_an_eyeball(back: float, counts: bool) -> None:
    """A sheet before an eyeball, and one whose lower half ends in it; a blink pushes either on."""
    points, triangles = plain.sheet((-8, 8), (-8, 8), 1.0)
    ahead = np.where(points[:, 1] > -2.0, 2.0, back) + plain.RADIUS
    at = points + plain.EYES[0] + ahead[:, None] * [0.0, 0.0, 1.0]
    push = {"eyeBlinkLeft": np.tile([0.0, 0.0, -6.0], (len(points), 1))}
    found = measured(plain.part("flesh", at, triangles, moves=push), plain.eyeball(0), plain.eyeball(1))
    assert ("eye" in found) is counts


def test_a_note_says_what_is_deeper_than_a_millimetre(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "Head", lambda data: data)
    monkeypatch.setattr(module, "find_mouth", lambda subject: None)
    for height, named in ((0.6, False), (1.2, True)):
        head: Any = plain.PlainHead([skin(), ball(height)])
        notes = overlap_notes(head)
        assert len(notes) == named
    assert "mm: skin passes through the teeth: the neutral face, " in notes[0]
    assert overlap_notes(head, lambda one: 2.0 * one.limit) == [f"{notes[0]}; in the mesh itself 4.0 mm"]
    assert str(Overlap(2.345, "eye", "jawOpen", "left eye", 2.0)) == (
        "2.3 mm: skin passes through the eyeball: shape jawOpen, left eye"
    )


def tilted(x: tuple[float, float], y: tuple[float, float], step: float, slope: float, z: float) -> Any:
    """A sheet of an eyeball's material whose height is ``z`` at x = 0."""
    points, triangles = plain.sheet(x, y, step)
    points[:, 2] = z + slope * points[:, 0]
    return plain.part("tilted", points, triangles, material="eye")


def roof(x: tuple[float, float], z: float = 5.0) -> Any:
    points, triangles = plain.sheet(x, (-10, 10), 1.0, z)
    return plain.part("roof", points, triangles, material="eye")


def test_what_another_part_covers_beside_the_end_of_a_crossing_does_not_lie_behind_it() -> None:
    """A strip ends in front of the skin; beside it the skin lies in front of everything, then under a roof."""
    skin = plain.part("face", *plain.sheet((-40, 40), (-40, 40), 1.0))
    strip = tilted((-6.0, 0.0), (-10, 10), 1.0, -0.3, -0.75)
    alone = measured(skin, strip)["eye"].mm
    assert 0.5 < alone < 1.2
    assert measured(skin, strip, roof((3.0, 9.0)))["eye"].mm == pytest.approx(alone, abs=0.1)


def test_a_large_triangle_that_is_just_cut_is_not_as_deep_as_it_is_large() -> None:
    """Its corner lies half a millimetre from the crossing, and five from the back of another part."""
    skin = plain.part("face", *plain.sheet((-60, 60), (-60, 60), 20.0))
    cut = tilted((0.3, 0.9), (-0.5, 0.5), 0.1, -0.3, 0.2)
    assert measured(skin, cut, roof((-5.0, 5.0))).get("eye") is None


def small(x: float) -> Any:
    """A ball 1.5 mm high above the skin, which alone has too little area."""
    points, triangles, normals = plain.ball((x, -60.0, -0.5), 2.0)
    return plain.part(f"ball{x}", points, triangles, material="teeth", normals=normals)


def test_areas_about_different_places_do_not_add_up() -> None:
    assert measured(skin(), small(-20.0), small(0.0), small(20.0)) == {}
    assert list(measured(skin(), small(-4.0), small(0.0), small(4.0))) == ["teeth"]


@pytest.mark.parametrize(("by", "shape"), [(0.3, ""), (1.0, "cheekPuff")])
def test_a_shape_that_lies_hardly_deeper_than_the_neutral_face_is_not_named(by: float, shape: str) -> None:
    found = measured(skin(moves=pushed("cheekPuff", by)), ball(3.0, material="eye"))
    assert found["eye"].shape == shape
