"""surface.readers.common"""

from pathlib import Path

import numpy as np
import pytest

from surface import DCPSurface, Domain, Slit, SurfaceFileError
from surface.readers.common import Location, NamedSurface, Ties, read_bytes, read_text, summary

SQUARE = [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]]


def sheet() -> DCPSurface:
    points = np.stack(np.meshgrid(np.arange(3.0), np.arange(4.0), [0.0], indexing="ij"), axis=-1).reshape(3, 4, 3)
    return DCPSurface.from_nurbs(1, 2, [0, 0, 1, 2, 2], [0, 0, 0, 0.5, 1, 1, 1], points, np.ones((3, 4)))


def test_a_summary_tells_points_degrees_and_domain() -> None:
    assert summary(NamedSurface("nose", sheet())) == "nose: 12 control points, degree 1 x 2, u 0 to 2, v 0 to 1"


@pytest.mark.parametrize(
    ("loops", "slits", "words"),
    [
        ([], [], ""),
        ([SQUARE], [], ", 1 trim loop"),
        ([SQUARE, (np.array(SQUARE) * 0.5 + 0.25)[::-1]], [], ", 2 trim loops"),
        ([], [Slit("u", 0.5, 0.2, 0.8)], ", 1 slit"),
    ],
)
def test_a_summary_counts_loops_and_slits(loops: list, slits: list, words: str) -> None:
    domain = Domain((0.0, 1.0, 0.0, 1.0), loops, slits)
    assert summary(NamedSurface("lip", sheet(), domain)).endswith("degree 1 x 2, u 0 to 1, v 0 to 1" + words)


def test_a_summary_names_closed_directions() -> None:
    angle = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([ring, ring + np.array([0, 0, 1])])
    ku, kv = [[k, k + 1, k + 2] for k in range(6)] * 2, [[0, 0, 1]] * 6 + [[0, 1, 1]] * 6
    tube = DCPSurface(points, np.ones(12), ku, kv, closed_u=(0, 6))
    text = summary(NamedSurface("tube", tube))
    assert "closed in u" in text and "closed in v" not in text


def test_locations_lead_to_messages_with_hints() -> None:
    here = Location(Path("a.json"))
    assert str(here.error("is bad")) == "a.json: is bad"
    assert here.error("is bad").hint == "export the file again, or take it from a copy"
    point = here.at("surfaces[0]").child(".points[1]")
    error = point.error("is bad", hint="mend it")
    assert (str(error), error.hint) == ("a.json, surfaces[0].points[1]: is bad", "mend it")
    assert str(point.at("line 3").error("x")) == "a.json, line 3: x"


def test_text_must_be_utf8_unless_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.tsm"
    path.write_bytes(b"ab\xffc")
    assert read_bytes(path) == b"ab\xffc"
    assert read_text(path, errors="replace") == "ab\ufffdc"
    with pytest.raises(SurfaceFileError, match=r"a\.tsm: is not UTF-8 \(line 1\), but probably Latin-1"):
        read_text(path)


def test_a_missing_file_is_named_with_its_cause(tmp_path: Path) -> None:
    with pytest.raises(SurfaceFileError, match=r"none\.xml: cannot be read: No such file") as caught:
        read_bytes(tmp_path / "none.xml")
    assert caught.value.hint == f"look at: ls -l {tmp_path / 'none.xml'}"


def test_ties_give_control_points_their_shares_of_the_files_points() -> None:
    points = {7: np.array([0.0, 0, 0]), 3: np.array([2.0, 0, 0]), 5: np.array([0.0, 4, 0])}
    ties = Ties.of([{3: 1.0}, {7: 0.25, 5: 0.75}, {5: -1.0, 3: 2.0}], points)
    assert ties.count == 3 and ties.points.tolist() == [[2, 0, 0], [0, 4, 0], [0, 0, 0]]  # in the order of numbers
    np.testing.assert_allclose(ties.apply(ties.points), [[2, 0, 0], [0, 3, 0], [4, -4, 0]])
    assert ties.apply(np.ones((3, 2))).tolist() == [[1, 1]] * 3
    none = Ties(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), 2, np.zeros((0, 3)))
    assert none.apply(np.zeros((0, 1))).tolist() == [[0.0], [0.0]]


@pytest.mark.parametrize(("deviation", "said"), [(0.0, ""), (0.01234, ", fitted near star points within 0.0123")])
def test_a_summary_tells_what_is_fitted(deviation: float, said: str) -> None:
    assert summary(NamedSurface("a", sheet(), deviation=deviation)).partition("v 0 to 1")[2] == said
    two = Domain((0.0, 1.0, 0.0, 1.0), slits=[Slit("u", 0.5, 0.2, 0.8), Slit("v", 0.5, 0.2, 0.8)])
    assert summary(NamedSurface("a", sheet(), two)).endswith(", 2 slits")


def test_text_may_begin_with_a_byte_order_mark_and_is_limited(tmp_path: Path) -> None:
    path = tmp_path / "a.tsm"
    path.write_bytes(b"\xef\xbb\xbfab")
    assert read_text(path) == read_text(path, errors="replace") == "ab"
    assert read_bytes(path, 5) == b"\xef\xbb\xbfab"
    with pytest.raises(SurfaceFileError, match="is larger than"):
        read_bytes(path, 4)
