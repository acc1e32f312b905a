"""Pieces that are neither face nor eyeballs: sorted by object, kind and size."""

from dataclasses import replace

import numpy as np
import pytest

from surface.fit.features.others import by_object, is_skin, points_of, why_out
from surface.fit.source.kinds import kinds
from surface.fit.source.mesh import FitMesh
from surface.readers.meshdata import Material


def squares(count: int, size: float, names: tuple[str, ...]) -> FitMesh:
    """Squares 50 mm apart; the first ones have a name each, the rest the last one."""
    one = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    vertices = np.vstack([one * size + [50.0 * k, 0, 0] for k in range(count)])
    faces = np.arange(len(vertices)).reshape(-1, 4)
    piece = np.minimum(np.arange(count), len(names) - 1)
    return FitMesh(vertices, faces, vertices[:, :2], faces, (), np.zeros((0, len(vertices), 3)), piece, names)


@pytest.mark.parametrize(
    ("count", "size", "scale", "kind"),
    [
        (11, 20, 1.0, "skin"), (12, 20, 1.0, "teeth"), (12, 25, 1.0, "skin"), (12, 25, 2.0, "teeth"),
        (11, 25, 2.0, "skin"),
    ],
)  # fmt: skip
def test_small_pieces_without_a_name_are_teeth_from_twelve_on(count, size, scale, kind):
    mesh = squares(count, size, ("Mesh",))
    every = list(range(count))
    assert by_object(mesh, np.arange(count), every, scale) == {("Mesh", kinds()[kind]): every}


def test_objects_are_sorted_by_their_kinds():
    mesh = squares(5, 30.0, ("Head", "Tongue", "Hair", "EyeIris"))
    found = by_object(mesh, np.arange(5), [1, 2, 3, 4], 1.0)
    assert {(name, kind.name): own for (name, kind), own in found.items()} == {
        ("Tongue", "tongue"): [1], ("Hair", "hair"): [2], ("EyeIris", "iris"): [3, 4],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "colour", "kind"),
    [
        ("Teeth", (0.49, 0.35, 0.35), "teeth"), ("Teeth", (0.12, 0.024, 0.025), "tongue"),
        ("Teeth", (0.2, 0.1, 0.1), "teeth"), ("Mouth", (0.97, 0.96, 0.97), "teeth"),
        ("Mouth", (0.25, 0.06, 0.05), "mouth"), ("Mouth", (0.1, 0.09, 0.09), "mouth"),
        ("Hair", (0.5, 0.1, 0.1), "hair"),
    ],
)  # fmt: skip
def test_pieces_inside_the_mouth_are_told_apart_by_their_colours(name, colour, kind):
    """One object of an avatar often holds teeth, gums and tongue, and its texture tells them apart."""
    mesh = replace(squares(2, 30.0, ("Head", name)), materials=(None, Material("m", (*colour, 1.0))))
    ((found, own),) = by_object(mesh, np.arange(2), [1], 1.0).items()
    assert found[1].name == kind and own == [1]


def test_what_may_be_skin_is_told_by_the_first_face_of_each_piece():
    mesh = squares(4, 30.0, ("Head", "Hair", "Iris", "Mesh"))
    label = np.array([1, 0, 3, 2])
    assert is_skin(mesh, label, 5).tolist() == [False, True, True, False, True]  # a piece without faces may be
    assert is_skin(replace(mesh, piece=np.zeros(0, int), pieces=()), label, 4).all()


def test_reasons_are_given_in_words():
    assert why_out("Hair", kinds()["hair"], 80, 80) == ""
    assert why_out("Hair", kinds()["hair"], 81, 80) == "'Hair': left out: 81 separate pieces are too many to fit"
    assert why_out("Gum", kinds()["gums"], 0, 80) == "'Gum': left out: no area"
    assert why_out("EyeL", kinds()["eye"], 1, 80) == "'EyeL': left out: eye"
    assert why_out("W", kinds()["eye_white"], 1, 80) == "'W': left out: eye white, part of an eye"


def test_points_are_those_of_the_chosen_faces():
    mesh = squares(3, 30.0, ("a",))
    np.testing.assert_array_equal(points_of(mesh, np.array([False, True, False])), mesh.vertices[4:8])
