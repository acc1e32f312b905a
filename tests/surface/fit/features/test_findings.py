"""What a fit says it found and did not find."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.fit.features.findings import findings
from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.head.model.parameters import rotation
from surface.head.model.placement import Placement

EYES = Landmarks(Eyes(np.array([[30.0, 30, 0], [-30, 30, 0]]), True, True, "two balls"))
BLINKS = [all_points("eyeBlinkLeft", (0, -4, 0)), all_points("eyeBlinkRight", (0, -4, 0))]


def test_everything_there_is_named():
    parts = [part("a", -40, groups=[*BLINKS, all_points("jawOpen", (0, -9, 0))])]
    parts += [replace(part(m, 50), material=m) for m in ("teeth", "tongue", "brow", "lash")]
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    placed = Placement(turn, 10.0, np.array([0.2, -1600.0, 4.0]), "cm")
    lines = findings(small_head(parts=parts, seams=[], paint=[], placement=placed), EYES)
    assert lines == [
        "placed: the file's unit is cm, up is z, forward is -y; moved by 0, -1600, 4 mm",
        "found: eyes 60 mm apart, of 24 mm, lids that close, a jaw that opens, teeth, tongue, brows or hair, lashes",
    ]


def test_what_is_missing_says_what_to_do():
    head = small_head(eye_radius=0.0, placement=Placement(scale=190.5))
    lines = "\n".join(findings(head, Landmarks()))
    assert "the file's unit is 190.5 mm, up is y, forward is z; it stands where it belongs" in lines
    assert "the head's place is not known" in lines and "no eyes:" in lines and "as a piece of its own" in lines
    assert "the lids do not move: the mesh has no shape eyeBlinkLeft or eyeBlinkRight" in lines and "--names" in lines
    assert "--expressions-from ict" in lines
    assert "not in the mesh, and not drawn: teeth, tongue, brows or hair, lashes" in lines
    assert "place is not known" not in "\n".join(findings(head, EYES))


def test_what_the_mesh_has_but_the_head_has_not_is_told_from_what_the_mesh_lacks():
    """Hair that could not be fitted was said not to be in the mesh."""
    lines = findings(small_head(eye_radius=0.0), EYES, {"hair", "skin", "tongue"})
    assert lines[-2:] == [
        "in the mesh, but left out and not drawn: tongue, brows or hair",
        "not in the mesh, and not drawn: teeth, lashes",
    ]


@pytest.mark.parametrize(("shift", "said"), [
    ([0.5, -0.5, 0.0], "it stands where it belongs"), ([0.51, 0.0, 0.0], "moved by 1, 0, 0 mm"),
    ([0.0, 0.0, -0.51], "moved by 0, 0, -1 mm"), ([-0.4, 2.0, 0.0], "moved by 0, 2, 0 mm"),
])  # fmt: skip
def test_a_shift_of_more_than_half_a_millimetre_is_said(shift, said):
    line = findings(small_head(placement=Placement(shift=np.array(shift), unit="mm")), EYES)[0]
    assert line == f"placed: the file's unit is mm, up is y, forward is z; {said}"


def test_a_head_that_stands_askew_is_said_to():
    askew = Placement(rotation(0.1, 0.0), 1.0, np.zeros(3), "mm")
    assert "it stands askew; it stands where it belongs" in findings(small_head(placement=askew), EYES)[0]
    assert not any(line.startswith("placed") for line in findings(small_head(), EYES))


def test_a_lid_without_a_shape_is_named_alone():
    head = small_head(parts=[part("a", -40, groups=BLINKS[:1])], seams=[], paint=[])
    lines = findings(head, EYES)
    assert any("no shape eyeBlinkRight, " in line for line in lines)
    assert "found: eyes 60 mm apart, of 24 mm" in lines


def test_hair_that_is_kept_as_it_is_is_not_said_to_be_missing():
    bare = small_head(eye_radius=0.0)
    assert "in the mesh, but left out and not drawn: brows" in findings(bare, EYES, {"brow"}, {"hair", "hat"})
    assert not any("hair" in line for line in findings(bare, EYES, (), {"hair"}))
    assert any("brows or hair" in line for line in findings(bare, EYES, (), {"hat"}))
