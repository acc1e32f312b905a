"""T-splines: a net comes back as the same NURBS, a T-junction gives the knots that the rays meet, damage."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from surface import DCPSurface, SurfaceFileError
from surface.readers import read_surface

Rect = tuple[float, float, float, float]
HEAD = "#TS0200\n\ndegree 3\ncap-type 1\nstar-smoothness 0\nunits 0.001 millimeters\nforce-bezier-end-conditions 1\n"
STEPS = {(1, 0): 0, (0, 1): 1, (-1, 0): 2, (0, -1): 3}
NAMES = ("EAST", "NORTH", "WEST", "SOUTH")
SIDES = (1, 2, 3, 0)
GRID = np.stack(np.meshgrid(np.linspace(0, 3, 40), np.linspace(0, 3, 31)), axis=-1).reshape(-1, 2)


def cells(us: Sequence[float], vs: Sequence[float]) -> list[Rect]:
    return [(a, b, c, d) for c, d in pairwise(vs) for a, b in pairwise(us)]


class Writer:
    """A T-mesh of rectangles as ``.tsm`` text; ``grip`` gives the position at (vertex, inward steps)."""

    def __init__(self, faces: list[Rect]) -> None:
        corners = {(x, y) for a, b, c, d in faces for x in (a, b) for y in (c, d)}
        self.vertices = sorted(corners, key=lambda p: (p[1], p[0]))
        self.us, self.vs = (sorted({p[k] for p in corners}) for k in range(2))
        self.links: dict[tuple, int] = {}
        loops = [self.around(face) for face in faces]
        for number, loop in enumerate(loops):
            for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
                self.links[a, b] = number
        for a, b in list(self.links):
            self.links.setdefault((b, a), -1)

    def around(self, face: Rect) -> list[tuple[float, float]]:
        a, b, c, d = face
        south = sorted(p for p in self.vertices if p[1] == c and a <= p[0] < b)
        east = sorted(p for p in self.vertices if p[0] == b and c <= p[1] < d)
        north = sorted((p for p in self.vertices if p[1] == d and a < p[0] <= b), reverse=True)
        west = sorted((p for p in self.vertices if p[0] == a and c < p[1] <= d), reverse=True)
        return south + east + north + west

    def direction(self, link: tuple) -> int:
        (a, b), (c, d) = link
        return STEPS[int(np.sign(c - a)), int(np.sign(d - b))]

    def next(self, link: tuple) -> tuple:
        face = self.links[link]
        return next(x for x in self.links if x[0] == link[1] and self.links[x] == face)

    def text(self, grip: dict[tuple, Sequence[float]] | None = None, turned: int = 0) -> str:
        """``turned``: how far the vertices' own frames are turned against the plane, but for the first's."""
        order = list(self.links)
        number = {link: i for i, link in enumerate(order)}
        following = {link: self.next(link) for link in order}
        before = {after: link for link, after in following.items()}
        edges = [link for link in order if number[link] < number[link[::-1]]]
        edge = {link: edges.index(link if link in edges else link[::-1]) for link in order}
        lines = [
            f"f {number[next(x for x in order if self.links[x] == k)]} 0" for k in range(max(self.links.values()) + 1)
        ]
        lines += [f"e {number[x]} {abs(x[0][0] - x[1][0]) + abs(x[0][1] - x[1][1])!r}" for x in edges]
        own = {v: next(x for x in order if x[0] == v) for v in self.vertices}
        lines += [
            f"v {number[own[v]]} {NAMES[(self.direction(own[v]) + turned * (i > 0)) % 4]}"
            for i, v in enumerate(self.vertices)
        ]
        for link in order:
            turn = (self.direction(before[link]) - self.direction(link) + 1) % 4
            vertex = self.vertices.index(link[0])
            fields = (number[before[link]], number[following[link]], number[link[::-1]], vertex, self.links[link])
            lines.append("l " + " ".join(map(str, (*fields, edge[link], turn))))
        lines += [f"ec {i} 0" for i, x in enumerate(edges) if -1 in (self.links[x], self.links[x[::-1]])]
        return HEAD + "\n".join(lines + self.grips(grip or {}, turned)) + "\n\ntol 1e-05\nver 904\n"

    def grips(self, grip: dict[tuple, Sequence[float]], turned: int) -> list[str]:
        owners, extras, points = ["0m odd-grip-map"], [], []
        for i, v in enumerate(self.vertices):
            inward = [(v[k] == x[0]) - (v[k] == x[-1]) for k, x in enumerate((self.us, self.vs))]
            slots = {(a, b): 0 for a in {0, inward[0]} for b in {0, inward[1]}}
            for k, slot in enumerate(sorted(slots, key=lambda s: abs(s[0]) + abs(s[1]))):
                slots[slot] = len(points)
                owners.append(f"0m {'gvp' if k == 0 else 'gv'} {i}")
                xyzw = grip.get((v, slot), (*v, 0.0, 1.0))
                points.append("0g " + " ".join(repr(float(x)) for x in xyzw))
            if len(slots) > 1:
                extras.append(self.extra(i, slots, turned * (i > 0)))
        return owners + extras + points

    def extra(self, vertex: int, slots: dict[tuple[int, int], int], turned: int) -> str:
        step = {direction: key for key, direction in STEPS.items()}
        ways = [step[(side - turned) % 4] for side in SIDES]
        counts = [int(way in slots) for way in ways]
        numbers = []
        for k, way in enumerate(ways):
            after = ways[(k + 1) % 4]
            if counts[k]:
                numbers.append(slots[way])
                if counts[(k + 1) % 4]:
                    numbers.append(slots[way[0] + after[0], way[1] + after[1]])
        return f"0m cg {vertex} 4 " + " ".join(map(str, counts + numbers))


def save(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "nose.tsm"
    file.write_text(text)
    return file


@pytest.mark.parametrize("turned", [0, 1, 3])
def test_a_net_is_the_same_nurbs(tmp_path: Path, turned: int) -> None:
    us, vs = [0, 0.5, 1.25, 3], [0, 1, 3]
    rng = np.random.default_rng(1)
    net, weights = rng.normal(size=(6, 5, 3)), rng.uniform(0.5, 2, (6, 5))
    knots = [[x[0]] * 3 + list(x) + [x[-1]] * 3 for x in (us, vs)]
    columns = [[0, 1, *range(2, len(x)), len(x), len(x) + 1] for x in (us, vs)]
    assert [len(c) for c in columns] == [6, 5]
    grip = {}
    for i, (u, du) in enumerate(lines(us)):
        for j, (v, dv) in enumerate(lines(vs)):
            grip[(u, v), (du, dv)] = (*net[i, j], weights[i, j])
    (item,) = read_surface(save(tmp_path, Writer(cells(us, vs)).text(grip, turned)))
    want = DCPSurface.from_nurbs(3, 3, *knots, net, weights)
    assert item.name == "nose"
    assert item.domain is None
    uv = GRID + np.array([want.rect[0] - item.surface.rect[0], want.rect[2] - item.surface.rect[2]])
    assert np.abs(item.surface.evaluate(GRID) - want.evaluate(uv)).max() < 1e-13


def lines(x: list) -> list[tuple[float, int]]:
    """Anchors along one direction: both ends have a second one, one knot further in."""
    return [(x[0], 0), (x[0], 1), *[(t, 0) for t in x[1:-1]], (x[-1], -1), (x[-1], 0)]


def test_rays_pass_under_a_t_junction(tmp_path: Path) -> None:
    faces = [(0, 1, 0, 1), (1, 2, 0, 1), (0, 2, 1, 2)]  # the line u = 1 ends at (1, 1)
    (item,) = read_surface(save(tmp_path, Writer([tuple(map(float, f)) for f in faces]).text()))
    s = item.surface
    assert s.n == 5 * 3 + 4 * 2
    found = {(tuple(s.points[i, :2]), tuple(s.knots_u[i]), tuple(s.knots_v[i])) for i in range(s.n)}
    assert ((1, 1), (0, 0, 1, 2, 2), (0, 0, 1, 2, 2)) in found
    assert ((0, 2), (0, 0, 0, 0, 2), (1, 2, 2, 2, 2)) in found
    assert ((0, 2), (0, 0, 0, 2, 2), (0, 1, 2, 2, 2)) in found  # a corner's grip between two sides
    assert ((0, 0), (0, 0, 0, 1, 2), (0, 0, 0, 1, 2)) in found
    assert ((2, 1), (0, 1, 2, 2, 2), (0, 0, 1, 2, 2)) in found
    assert np.isfinite(s.evaluate(GRID / 1.5)).all()
    assert np.allclose(s.evaluate([[0, 0], [2, 0], [2, 2]])[:, :2], [[0, 0], [2, 0], [2, 2]], atol=1e-14)


GOOD = Writer(cells([0, 1, 2], [0, 1, 2])).text()
ELL = Writer([(0, 1, 0, 1), (1, 2, 0, 1), (0, 1, 1, 2)]).text()


def line_of(text: str, start: str, nth: int = 0) -> str:
    return [x for x in text.splitlines() if x.startswith(start)][nth]


def changed(start: str, new: str, nth: int = 0) -> str:
    return GOOD.replace(line_of(GOOD, start, nth) + "\n", new and new + "\n", 1)


def twice() -> str:
    """Two separate squares in one file."""
    writer = Writer([(0.0, 1.0, 0.0, 1.0), (3.0, 4.0, 0.0, 1.0)])
    return writer.text()


def bare() -> str:
    """The first corner's extra grips deleted."""
    numbers = line_of(GOOD, "0m cg").split()[-3:]
    text, kept = [], 0
    owner = [x for x in GOOD.splitlines() if x.startswith(("0m gv", "0m gvp"))]
    for line in GOOD.splitlines():
        if line.startswith("0g"):
            text.append("0g" if str(kept) in numbers else line)
            kept += 1
        elif line != line_of(GOOD, "0m cg"):
            text.append(line)
    assert len(owner) == kept
    return "\n".join(text) + "\n"


TWICE, BARE = twice(), bare()
LINKS = line_of(GOOD, "l ").split()
BAD = {
    "empty": ("", "line 1: is no T-spline"),
    "header": (GOOD[1:], "line 1: is no T-spline"),
    "truncated": (GOOD[: GOOD.index("\nl ") + 60], r"line \d+: (\"l\" needs 7 values|refers to \"l\")"),
    "cut off": (GOOD[: GOOD.index("0g ")], "the file does not have"),
    "left out": (
        changed("0m cg", "0m cg 0 4 1 0 0 1 1 -1 3"),
        "vertex 0 lacks grips, but is neither",
    ),
    "degree": (GOOD.replace("degree 3", "degree 2"), 'line 3: "degree" is 2'),
    "ends": (GOOD.replace("conditions 1", "conditions 0"), "line 7: .*other ends is not read"),
    "no ends": (GOOD.replace("force-bezier-end-conditions 1\n", ""), "line 1: .*is missing"),
    "no links": (HEAD, "has no links"),
    "NaN": (changed("0g ", "0g nan 0 0 1"), r"line \d+: numbers must be finite"),
    "word": (changed("0g ", "0g x 0 0 1"), r"line \d+: needs numbers"),
    "weight": (changed("0g ", "0g 0 0 0 -1"), "weight must be positive, not -1"),
    "values": (changed("0g ", "0g 0 0 0"), '"0g" needs 4 values, has 3'),
    "interval": (changed("e ", "e 0 0"), "interval must be positive"),
    "sum": (changed("e ", "e 0 1.5"), r"line \d+: vertex \d comes to lie at two places"),
    "whole": (changed("l ", "l 0 x 0 0 0 0 0"), "needs whole numbers"),
    "turn": (changed("l ", " ".join([*LINKS[:-1], "5"])), "turn must be 0, 1 or 2"),
    "star": (changed("l ", " ".join([*LINKS[:-1], "2"])), r"line \d+: face \d is no rectangle"),
    "closed": (
        re.sub(r"^(l \S+ \S+ \S+ \S+) -1 ", r"\1 0 ", GOOD, flags=re.M),
        "edge 0 is creased inside",
    ),
    "leaving": (changed("v ", "v 1 EAST"), r'line \d+: "v" 0 names link 1'),
    "pieces": (TWICE, r"line \d+: link \d+ belongs to another piece"),
    "bare corner": (BARE, r"line \d+: vertex 0 has 1 grips, 4 belong there"),
    "link": (changed("l ", " ".join([*LINKS[:2], "99", *LINKS[3:]])), 'refers to "l" 99'),
    "compass": (changed("v ", "v 0 UP"), "compass point"),
    "owner": (changed("0m gv ", "0m gv 77"), 'refers to "v" 77'),
    "owners": (changed("0m gv ", ""), r'25 grips \("0g"\) and 24 owners'),
    "counts": (changed("0m cg", "0m cg 0 4 1 0 0 1 1"), "does not fit its counts"),
    "valence": (changed("0m cg", "0m cg 0 5 1 0 0 1 1 2 3"), "neither a star point"),
    "outside": (changed("0m cg", "0m cg 0 4 0 1 1 0 1 3 2"), "Bezier ends have none"),
    "lost": (changed("0m cg", ""), r"line \d+: grip \d+ has no place"),
    "crease": (GOOD.replace("ec 0 0", "ec 1 0").replace("ec", "ec", 1), "creased inside"),
    "outline": (ELL, r"vertex \d has 2 grips, 4 belong there"),
}


@pytest.mark.parametrize("name", BAD)
def test_every_damage_is_one_clear_error(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    with pytest.raises(SurfaceFileError, match=message) as caught:
        read_surface(save(tmp_path, text))
    assert "nose.tsm" in str(caught.value)
    assert caught.value.hint
