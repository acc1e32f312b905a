"""Shape names of other heads."""

from surface.fit.names import sources_of
from surface.head.parameters import SHAPES


def test_sides_are_renamed_and_halves_are_joined():
    found = sources_of(("jawOpen", "eyeBlink_L", "eyeBlink_R", "browInnerUp_L", "browInnerUp_R", "PupilDilate_L"))
    assert found == {"eyeBlinkLeft": [1], "eyeBlinkRight": [2], "jawOpen": [0], "browInnerUp": [3, 4]}


def test_a_lone_half_is_left_out_and_own_names_pass():
    assert sources_of(("browInnerUp_L",)) == {}
    assert sources_of(SHAPES) == {name: [i] for i, name in enumerate(SHAPES)}
