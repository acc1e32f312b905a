"""What a transfer's report says of a map, of landmarks, of openings, and of shapes that were changed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import made_face
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.fit.transfer.align import Similarity, face_region
from surface.fit.transfer.register import Mark, Matcher
from surface.fit.transfer.reports import report as module
from surface.fit.transfer.reports.report import landmarks_of, openings_of, registration_errors, reseated
from surface.fit.transfer.scan import Samples
from surface.head.model.data import Group

Z = np.array([0.0, 0.0, 1.0])


def on_a_plane(z: float, *, below: float = np.inf, border: bool = False) -> Samples:
    """Samples of a plane that faces +z, as far up as ``below``."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-70.0, 71.0, 2.0), np.arange(-100.0, 101.0, 2.0)))
    at = np.column_stack([x, y, np.full(len(x), z)])[y < below]
    return Samples(at, np.tile(Z, (len(at), 1)), np.full(len(at), border))


class Flattened:
    """Stands for a map that lays everything into the plane z = 0."""

    def turned(self, points: Any, normals: Any) -> Any:
        return points * [1.0, 1.0, 0.0], np.tile(Z, (len(points), 1))


def measured(samples: Samples, farthest: float = 9.0) -> tuple[Any, float]:
    done: Any = SimpleNamespace(warp=Flattened())
    return registration_errors(made_face.template(), done, Matcher(samples), farthest)


def test_the_map_is_measured_along_normals_where_the_scan_shows_the_front() -> None:
    errors, share = measured(on_a_plane(1.5))
    assert share == 1.0
    assert (errors.rms, errors.p99, errors.max) == (pytest.approx(1.5), pytest.approx(1.5), pytest.approx(1.5))
    template = made_face.template()
    front = template.points[face_region(template)]
    middle = float(np.median(front[:, 1]))
    _, share = measured(on_a_plane(1.5, below=middle), 3.0)
    assert share == pytest.approx((front[:, 1] < middle).mean(), abs=0.08)
    errors, share = measured(on_a_plane(1.5, border=True))
    assert share == 0.0 and np.isnan(errors.max)
    assert measured(on_a_plane(9.5))[1] == 0.0


def test_landmarks_lie_in_the_scans_own_coordinates_and_are_so_far_from_the_heads() -> None:
    turn = Rotation.from_euler("xyz", [80, 10, 20], degrees=True).as_matrix()
    found = Similarity(turn, 1000.0, np.array([5.0, -7.0, 9.0]))
    place = np.array([0.01, -0.02, 0.03])
    marks = {"chin": Mark(found.points(place), "given"), "nose_tip": Mark(np.zeros(3), "found", 0.7)}
    with pytest.MonkeyPatch.context() as patch:
        chin_of_head = found.points(place) + np.array([0.0, 3.0, 4.0])
        own = {"chin": chin_of_head, "nose_tip": np.zeros(3), "mouth_left": np.ones(3)}
        patch.setattr(module, "find_landmarks", lambda head, contacts: own)
        head: Any = SimpleNamespace(data=SimpleNamespace(contacts=[]))
        chin, nose = landmarks_of(head, marks, found)
    assert (chin.name, chin.how, chin.sure, nose.how, nose.sure) == ("chin", "given", 1.0, "found", 0.7)
    np.testing.assert_allclose(chin.place, place, atol=1e-12)
    assert chin.off_mm == pytest.approx(5.0) and nose.off_mm == 0.0


LINE = np.column_stack([np.linspace(-25.0, 25.0, 50), np.zeros(50), np.zeros(50)])


def head_with(rims: Any) -> Any:
    """A head whose three openings have the same rims (k, 3); places are their numbers."""
    numbers = np.stack([np.arange(len(rims)), np.zeros(len(rims))], axis=1).reshape(2, -1, 1, 2)
    contacts = [
        SimpleNamespace(name=name, part="face", eye=eye, places=numbers)
        for name, eye in (("lips", -1), ("left_lids", 0), ("right_lids", 1))
    ]
    surface = SimpleNamespace(evaluate=lambda uv: rims[uv[:, 0].astype(int)])
    return SimpleNamespace(data=SimpleNamespace(contacts=contacts), part=lambda name: SimpleNamespace(surface=surface))


def opening(*places: Any, border: Any = ()) -> list[str]:
    """The first word said of mouth, left and right eye for samples, and for places at a border."""
    at = np.vstack([np.full((1, 3), 500.0), *places, *border])
    is_border = np.arange(len(at)) >= len(at) - sum(map(len, border))
    found = openings_of(head_with(LINE), Samples(at, np.tile(Z, (len(at), 1)), is_border))
    assert list(found) == ["mouth", "left eye", "right eye"]
    return [what.split()[0].rstrip(":") for what in found.values()]


@pytest.mark.parametrize(("share", "off", "word"), [(0.6, 2.9, "a"), (0.4, 2.9, "closed"), (1.0, 3.1, "closed")])
def test_a_rim_along_a_border_of_the_scan_is_a_hole(share: float, off: float, word: str) -> None:
    border = LINE[: round(share * len(LINE))] + np.array([0.0, off, 0.0])
    if share < 1:
        border = border[border[:, 0] < LINE[round(share * len(LINE)) - 3, 0]]
    assert opening(border=(border,)) == [word] * 3


def behind(count: int, x: float = 0.0, y: float = 0.0, z: float = -10.0) -> Any:
    return np.tile([x, y, z], (count, 1))


@pytest.mark.parametrize(
    ("places", "goes_on"),
    [
        (behind(21), True), (behind(20), False),
        (behind(21, z=-5.1), True), (behind(21, z=-4.9), False),
        (behind(21, z=-24.9), True), (behind(21, z=-25.1), False),
        (behind(21, x=17.4), True), (behind(21, x=17.6), False),
        (behind(21, x=-17.4), True), (behind(21, x=-17.6), False),
        (behind(21, y=1.9), True), (behind(21, y=2.1), False), (behind(21, y=-1.9), True), (behind(21, y=-2.1), False),
    ],
)  # fmt: skip
def test_a_mouth_is_open_where_the_scan_goes_on_behind_its_lips(places: Any, goes_on: bool) -> None:
    """Within 0.35 of its width to either side, 2 mm above and below, 5 to 25 mm deep; eyes are never open so."""
    assert opening(places) == ["open" if goes_on else "closed", "closed", "closed"]


def head_of(*groups: Any) -> Any:
    return SimpleNamespace(parts=[SimpleNamespace(groups=list(each)) for each in groups])


def group(name: str, factors: Any, ids: Any = (0, 1, 2, 3)) -> Group:
    """Points that move by 10, 10, 10 and 0.9 mm, times factors."""
    moves = np.diag([10.0, 10.0, 10.0, 0.9])[:, :3] + np.array([[0, 0, 0]] * 3 + [[0.9, 0, 0]])
    return Group(name, np.array(ids, np.int32), (moves * np.array(factors)[:, None]).astype(np.float32))


def test_shapes_that_were_lengthened_or_shortened_are_named_with_their_factors() -> None:
    one = (1.0, 1.0, 1.0, 1.0)
    before = head_of([group("a", one), group("b", one), group("c", one)], [group("a", one)])
    after = head_of(
        [group("a", (0.8, 1.0, 1.0, 7.0)), group("b", (1.0, 1.009, 1.0, 1.0)), group("new", one)],
        [group("a", (1.0, 1.3, 1.0, 1.0))],
    )
    found = reseated(before, after)
    assert list(found) == ["a"]  # what hardly moves does not count, a hundredth is no change, new shapes have no factor
    assert found["a"] == (pytest.approx(0.8), pytest.approx(1.3))
    longer = reseated(head_of([group("b", one)]), head_of([group("b", (1.0, 1.011, 1.0, 1.0))]))
    assert longer == {"b": (pytest.approx(1.0), pytest.approx(1.011))}


def test_shapes_of_other_points_are_not_compared() -> None:
    one = (1.0, 1.0, 1.0, 1.0)
    twice = group("a", (2.0, 2.0, 2.0, 2.0), (0, 1, 2, 4))
    assert reseated(head_of([group("a", one)]), head_of([twice])) == {}
    fewer = Group("a", np.arange(3, dtype=np.int32), 2.0 * group("a", one).moves[:3])
    assert reseated(head_of([group("a", one)]), head_of([fewer])) == {}
    still = group("a", (0.0, 0.0, 0.0, 0.0))
    assert reseated(head_of([still]), head_of([group("a", one)])) == {}
