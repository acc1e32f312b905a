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
    np.testing.assert_allclose(dark.attributes["albedo"][0], skin_tone(1.0), rtol=0.25)
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


def test_forehead_and_nose_shine_more_than_the_jaws_side_and_lips_as_they_are_painted():
    own = skin()
    own.vertices = np.array([[0.0, -7, 110], [0, -35, 100], [62, -20, 60]], np.float32)
    apply_look([own], Look(), EYES)
    nose, lip, jaw = own.attributes["gloss"][:, 0]
    assert nose > 0.38 > 0.3 > jaw > 0.0
    assert abs(lip - 0.75) < 0.03


def test_skin_without_gloss_of_its_own_is_given_some_and_none_where_nothing_is_painted():
    own, bare = skin(), part("skin")
    del own.attributes["gloss"]
    apply_look([own, bare], Look(melanin=0.5), EYES)
    assert own.attributes["gloss"].shape == (3, 1) and not bare.attributes


def test_dark_skin_is_uneven_and_light_skin_is_not():
    spread = []
    for melanin in (0.0, 1.0):
        own = skin()
        own.attributes["albedo"] = np.tile(np.float32(skin_tone(0.2)), (3, 1))
        own.attributes["lips"] = np.zeros((3, 1), np.float32)
        own.vertices = np.array([[30.0, 5, 90], [30, 29, 90], [57, -24, 60]], np.float32)  # cheek, socket, jaw
        apply_look([own], Look(melanin=melanin), EYES)
        spread.append(np.log(own.attributes["albedo"][0] / own.attributes["albedo"][1:])[:, 0])
    np.testing.assert_allclose(spread[0], 0.0, atol=1e-5)
    assert (spread[1] > 0.08).all()
