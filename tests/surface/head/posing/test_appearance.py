"""Colours of a person on the parts of a head."""

from types import SimpleNamespace

import numpy as np

from surface.head.model.look import Look, skin_tone
from surface.head.posing.appearance import apply_look

EYES = np.array([[30.0, 30, 80], [-30, 30, 80]])


def part(material, **attributes):
    """Three vertices: on the cheek, on the lip, far behind."""
    vertices = np.array([[20.0, 5, 90], [0, -35, 100], [0, 30, -90]], np.float32)
    return SimpleNamespace(material=material, vertices=vertices, attributes=attributes)


def skin():
    albedo = np.tile(np.float32(skin_tone(0.2)), (3, 1))
    albedo[1] *= (0.75, 0.45, 0.5)
    return part("skin", albedo=albedo, gloss=np.float32([[0.3], [0.75], [0.3]]), thin=np.ones((3, 1), np.float32))


def test_dark_skin_is_dark_with_lips_that_stand_out_less_and_lets_no_light_through():
    light, dark = skin(), skin()
    apply_look([light], Look(melanin=0.0), EYES)
    apply_look([dark], Look(melanin=1.0), EYES)
    np.testing.assert_allclose(dark.attributes["albedo"][0], skin_tone(1.0), rtol=1e-5)
    contrast = [p.attributes["albedo"][1] / p.attributes["albedo"][0] for p in (light, dark)]
    assert (contrast[1] > contrast[0]).all() and contrast[1][0] > contrast[1][1]
    assert dark.attributes["thin"].max() < 0.2 < light.attributes["thin"].min()


def test_a_lip_colour_is_only_on_lips():
    plain, painted = skin(), skin()
    apply_look([plain], Look(melanin=0.4), EYES)
    apply_look([painted], Look(melanin=0.4, lips=(0.0, 0.0, 1.0)), EYES)
    changed = (painted.attributes["albedo"] != plain.attributes["albedo"]).any(axis=1)
    assert changed.tolist() == [False, True, False]
    assert painted.attributes["albedo"][1, 2] > 0.6


def test_painted_lips_count_instead_of_gloss():
    own, plain = skin(), skin()
    for each in (own, plain):
        each.attributes["lips"] = np.float32([[0.5], [0.0], [0.0]])
    apply_look([plain], Look(melanin=0.4), EYES)
    apply_look([own], Look(melanin=0.4, lips=(0.0, 0.0, 1.0)), EYES)
    changed = (own.attributes["albedo"] != plain.attributes["albedo"]).any(axis=1)
    assert changed.tolist() == [True, False, False]


def test_freckles_grow_where_the_sun_reaches():
    own = skin()
    apply_look([own], Look(freckles=0.5), EYES)
    grown = own.attributes["freckles"][:, 0]
    assert 0.1 < grown[0] <= 0.5 and grown[2] == 0.0
    np.testing.assert_array_equal(own.attributes["albedo"], skin().attributes["albedo"])


def test_eyes_and_brows_have_one_colour_each():
    eye, brow = part("eye"), part("brow")
    apply_look([eye, brow], Look(iris=(0.1, 0.2, 0.3), brow=(0.3, 0.2, 0.1), brow_strength=0.5), EYES)
    np.testing.assert_allclose(eye.attributes["iris"], np.tile([0.1, 0.2, 0.3], (3, 1)))
    np.testing.assert_allclose(brow.attributes["albedo"][0], [0.3, 0.2, 0.1])
    assert (brow.attributes["strength"] == 0.5).all()
