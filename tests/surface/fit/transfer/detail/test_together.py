"""Borders of skin that are one on the head come together half-way, and the skin beside them with them."""

from types import SimpleNamespace

import numpy as np

from surface.fit.transfer.detail.together import Side, brought_together, sides_of
from surface.head import Seam


def strip(name, u0, n=6, columns=4):
    """A part of n rows along v and some columns from ``u0`` on in u, 1 apart."""
    u, v = np.meshgrid(u0 + np.arange(columns), np.arange(n), indexing="ij")
    uv = np.column_stack([u.ravel(), v.ravel()]).astype(float)
    own = np.arange(n)
    edges = np.concatenate([np.column_stack([c * n + own[:-1], c * n + own[1:]]) for c in (0, columns - 1)])
    return SimpleNamespace(name=name, mesh=SimpleNamespace(uv=uv), borders=edges)


def test_borders_along_a_seam_are_found_in_its_order():
    one, two = strip("a", 0.0), strip("b", 3.0, 11)
    two.mesh.uv[:, 1] *= 0.5
    seam = Seam("a", "b", np.array([[3.0, 5.0], [3.0, 0.0]]), np.array([[3.0, 5.0], [3.0, 0.0]]))
    ((first, second),) = sides_of({"a": one, "b": two}, [seam, Seam("a", "c", seam.uv_a, seam.uv_b)])
    np.testing.assert_array_equal(first.ids, 18 + np.arange(6)[::-1])
    np.testing.assert_allclose(first.at, np.linspace(0, 1, 6))
    np.testing.assert_array_equal(second.ids, np.arange(11)[::-1])


def test_a_closed_seam_goes_on_at_its_ends():
    part = strip("a", 0.0, 5, 2)
    part.borders = np.array([[0, 4], [4, 9], [9, 5], [5, 0]])
    loop = np.array([[0.0, 0.0], [0.0, 4.0], [1.0, 4.0], [1.0, 0.0], [0.0, 0.0]])
    ((side, _),) = sides_of({"a": part}, [Seam("a", "a", loop, loop)])
    np.testing.assert_allclose(side.at, [-1.0, 0.0, 1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(side.ids, [5, 0, 4, 9, 5, 0])


def test_both_borders_meet_half_way_also_between_vertices():
    line = np.linspace(0.0, 4.0, 5)
    places = {
        "a": np.column_stack([line, 0 * line, 0 * line]),
        "b": np.array([[0.0, 2.0, 0.0], [2.0, 2.0, 0.0], [4.0, 2.0, 0.0], [9.0, 9.0, 9.0]]),
    }
    sides = [(Side("a", np.arange(5), line), Side("b", np.arange(3), line[::2]))]
    found = brought_together(places, sides)
    np.testing.assert_array_equal(found["b"][0], [0, 1, 2])
    for name in ("a", "b"):
        np.testing.assert_allclose(found[name][1][:, 1], 1.0, atol=0.02)
    np.testing.assert_array_equal(places["a"][:, 1], 0.0)  # what was given is not changed


def test_where_three_borders_meet_they_meet_in_one_place():
    ends = {"a": [0.0, 0.0, 0.0], "b": [3.0, 0.0, 0.0], "c": [0.0, 3.0, 0.0]}
    places = {name: np.array([at, [10.0, 10.0, 10.0]]) for name, at in ends.items()}
    side = {name: Side(name, np.array([0, 1]), np.array([0.0, 1.0])) for name in ends}
    found = brought_together(places, [(side["a"], side["b"]), (side["b"], side["c"]), (side["c"], side["a"])])
    for _, at in found.values():
        np.testing.assert_allclose(at[0], [1.0, 1.0, 0.0], atol=1e-3)
        np.testing.assert_allclose(at[1], 10.0)


def test_a_head_without_seams_stays():
    found = brought_together({"a": np.zeros((3, 3))}, [])
    assert not len(found["a"][0])
