"""surface.readers.tsmfile: records of single lines, and references that do not exist."""

from pathlib import Path

import pytest

from surface import SurfaceFileError
from surface.readers.common import Location
from surface.readers.tsmfile import Link, TsmFile, parse

#: A triangle's worth of entities: the parser knows nothing of what they look like together.
LINES = """\
#TS0200 and more
degree 3   # cubic
degree 4
units 0.001 millimeters
f 0 0
e 0 1.5
e
e 1 0.25
v 0 EAST
v 1 SOUTH

l 9 1 1 0 -1 0 2
l 9 0 0 1 7 2 0
ec 2 0
0m odd-grip-map
0m gvp 0
0m gv 1
0m gv -1
0m cg 1 4 1 0 0 1 0 1 2
0g 1 2 3 1
0g -1 0.5 1e2 2
0g 0 0 0 1
"""


def read(text: str = LINES) -> TsmFile:
    return parse(Location(Path("a.tsm")), text)


def test_records_keep_their_numbers_lines_and_values() -> None:
    file = read()
    assert file.header["degree"] == (2, "3"), "the first of a keyword counts"
    assert file.header["units"] == (4, "0.001 millimeters")
    assert file.header["0m"] == (15, "odd-grip-map")
    assert file.edges == {0: 1.5, 2: 0.25}
    assert file.vertices == {0: (9, 0, "EAST"), 1: (10, 1, "SOUTH")}
    assert file.links == {0: Link(12, 1, 1, 0, -1, 0, 2), 1: Link(13, 0, 0, 1, 7, 2, 0)}
    assert file.creases == [(14, 2)]
    assert file.owners == [(16, True, 0), (17, False, 1), (18, False, -1)]
    assert file.extras == [(19, 1, [1, 0, 0, 1], [0, 1, 2])]
    assert file.grips == {0: (20, [1, 2, 3, 1]), 1: (21, [-1, 0.5, 100, 2]), 2: (22, [0, 0, 0, 1])}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("#TS0200", "#TS0201", "line 1: is no T-spline file"),
        ("e 0 1.5", "e 0 0", "line 6: the knot interval must be positive, not 0"),
        ("e 0 1.5", "e 0", 'line 6: "e" needs 2 values, has 1'),
        ("e 0 1.5", "e 0 inf", "line 6: numbers must be finite, not 0 inf"),
        ("e 0 1.5", "e", 'line 12: refers to "e" 0, which'),
        ("v 1 SOUTH", "v 1 south", "line 10: 'south' is no compass point"),
        ("v 1 SOUTH", "v x SOUTH", "line 10: needs whole numbers, not 'x'"),
        ("v 1 SOUTH", "v 0 SOUTH", 'line 10: "v" 1 names link 0, which does not leave it'),
        ("v 1 SOUTH", "v 5 SOUTH", 'line 10: "v" 1 names link 5'),
        ("l 9 0 0 1 7 2 0", "l 9 0 0 1 7 2 3", "line 13: turn must be 0, 1 or 2, not 3"),
        ("l 9 0 0 1 7 2 0", "l 9 0 0 1 7 2 -1", "line 13: turn must be 0, 1 or 2, not -1"),
        ("l 9 0 0 1 7 2 0", "l 9 2 0 1 7 2 0", 'line 13: refers to "l" 2'),
        ("l 9 0 0 1 7 2 0", "l 9 0 3 1 7 2 0", 'line 13: refers to "l" 3'),
        ("l 9 0 0 1 7 2 0", "l 9 0 0 2 7 2 0", 'line 13: refers to "v" 2'),
        ("l 9 0 0 1 7 2 0", "l 9 0 0 1 7 1 0", 'line 13: refers to "e" 1'),
        ("ec 2 0", "ec", "line 14: needs whole numbers, not 'nothing'"),
        ("0m gvp 0", "0m gvp", "line 16: needs whole numbers, not 'nothing'"),
        ("0m gvp 0", "0m gvp -1", 'line 16: refers to "v" -1'),
        ("0m gv 1", "0m gv 2", 'line 17: refers to "v" 2'),
        ("0m gv 1\n", "", r'a.tsm: has 3 grips \("0g"\) and 2 owners'),
        ("0m cg 1 4", "0m cg 2 4", 'line 19: refers to "v" 2'),
        ("0m cg 1 4", "0m cg 2 3", 'line 19: refers to "v" 2'),
        ("0m cg 1 4", "0m cg 1 0", "line 19: a vertex with extra grips must have sides, 4 if"),
        ("0m cg 1 4 1 0 0 1 0 1 2", "0m cg 1", "line 19: a vertex with extra grips must have sides, 4 if"),
        ("0m cg 1 4 1 0 0 1 0 1 2", "0m cg", "line 19: a vertex with extra grips must have sides, 4 if"),
        ("0 1 2\n0g", "0 1\n0g", "line 19: lists 2 grips, which does not fit"),
        ("4 1 0 0 1 0 1 2", "4 1 0 0", "line 19: lists 0 grips, which does not fit"),
        ("4 1 0 0 1 0 1 2", "4 -1 0 0 -1 0", "line 19: lists 1 grips, which does not fit"),
        ("1 0 0 1 0 1 2", "1 0 0 1 0 1 3", 'line 19: refers to a "0g"'),
        ("0g 1 2 3 1", "0g 1 2 3 0", "line 20: the weight must be positive, not 0"),
        ("0g 1 2 3 1", "0g 1 2 3 x", "line 20: needs numbers"),
        ("0g 1 2 3 1", "0g 1 2 3 1 1", 'line 20: "0g" needs 4 values, has 5'),
    ],
)
def test_a_wrong_line_is_named(old: str, new: str, message: str) -> None:
    assert LINES.count(old) == 1
    with pytest.raises(SurfaceFileError, match=message) as caught:
        read(LINES.replace(old, new))
    assert caught.value.hint


def test_deleted_grips_keep_the_numbers_of_those_after_them() -> None:
    file = read(LINES.replace("0g -1 0.5 1e2 2", "0g").replace("0 1 2\n0g", "0 0 2\n0g"))
    assert sorted(file.grips) == [0, 2]
    assert len(file.owners) == 3


def test_what_follows_the_numbers_of_creases_and_grips_is_not_read() -> None:
    file = read(
        LINES.replace("ec 2 0", "ec 2 hard").replace("0m gvp 0", "0m gvp 0 x").replace("0m gv 1", "0m gv 1 y z")
    )
    assert file.creases == read().creases and file.owners == read().owners
