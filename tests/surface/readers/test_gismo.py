"""G+Smo's XML: known values, THB-splines against a direct evaluation of their definition, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

from surface import SurfaceFileError
from surface.readers import gismo, read_surface
from surface.readers.common import Location

OPEN = "0 0 0 0.25 0.5 0.75 1 1 1"
GRID = np.stack(np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 37)), axis=-1).reshape(-1, 2)


def tensor(knots_u: str = OPEN, knots_v: str = OPEN, degree: int = 2, extra: str = "") -> str:
    sides = "".join(
        f'<Basis type="BSplineBasis" index="{i}">\n<KnotVector degree="{degree}">{knots}</KnotVector></Basis>\n'
        for i, knots in enumerate((knots_u, knots_v))
    )
    return f'<Basis type="TensorBSplineBasis2" {extra}>\n{sides}</Basis>\n'


def geometry(kind: str, basis: str, coefs: np.ndarray, attributes: str = "") -> str:
    rows = "\n".join(" ".join(repr(float(x)) for x in row) for row in coefs)
    text = f'<coefs geoDim="{coefs.shape[1]}" {attributes}>{rows}\n</coefs>'
    return f'<?xml version="1.0"?>\n<xml>\n<Geometry type="{kind}" id="7">\n{basis}{text}\n</Geometry>\n</xml>\n'


def hierarchy(kind: str, boxes: list[tuple[int, ...]], base: str | None = None, extra: str = "") -> str:
    rows = "".join(f'<box level="{b[0]}">{b[1]} {b[2]} {b[3]} {b[4]}\n</box>\n' for b in boxes)
    return f'<Basis type="{kind}Basis2" {extra}>\n{base or tensor()}{rows}</Basis>\n'


def save(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "a.xml"
    file.write_text(text)
    return file


class Direct:
    """A THB- or HB-spline by its definition: every function sampled on the grid, level by level.

    Truncation works on coefficients over the next level's whole basis, which are found by solving for them at
    samples; nothing here is shared with the reader.
    """

    def __init__(self, knots: list[list[np.ndarray]], degree: int, boxes: list[tuple[int, ...]]) -> None:
        self.knots, self.degree, self.boxes = knots, degree, boxes
        self.known: dict[tuple[int, int], np.ndarray] = {}
        self.grid: dict[tuple[int, int], np.ndarray] = {}

    def functions(self, level: int, x: np.ndarray, axis: int) -> np.ndarray:
        t = self.knots[level][axis]
        n = len(t) - self.degree - 1
        columns = [np.nan_to_num(BSpline(t, np.eye(n)[i], self.degree)(np.minimum(x, 1 - 1e-15))) for i in range(n)]
        return np.stack(columns, axis=1)

    def step(self, level: int, axis: int) -> np.ndarray:
        """(nf, nc): coarse coefficients to fine ones."""
        if (level, axis) in self.known:
            return self.known[level, axis]
        x = np.linspace(0, 1, 400)
        fine, coarse = self.functions(level + 1, x, axis), self.functions(level, x, axis)
        a = np.linalg.lstsq(fine, coarse, rcond=None)[0]
        self.known[level, axis] = np.where(np.abs(a) < 1e-11, 0, a)
        return self.known[level, axis]

    def depth(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        out = np.zeros(u.shape, dtype=int)
        for level, a, b, c, d in self.boxes:
            line = [np.unique(t) for t in self.knots[level]]
            held = (u > line[0][a]) & (u < line[0][c]) & (v > line[1][b]) & (v < line[1][d])
            out[held] = np.maximum(out[held], level)
        return out

    def least(self, level: int, i: int, j: int) -> int:
        ku, kv = (self.knots[level][k][m : m + self.degree + 2] for k, m in enumerate((i, j)))
        u, v = np.meshgrid(np.linspace(ku[0], ku[-1], 65)[1::2], np.linspace(kv[0], kv[-1], 65)[1::2])
        return int(self.depth(u, v).min())

    def sampled(self, truncate: bool) -> np.ndarray:
        """(m, k): all active functions at GRID, in G+Smo's order."""
        columns = []
        for level in range(len(self.knots)):
            nu, nv = (len(t) - self.degree - 1 for t in self.knots[level])
            pairs = [(i, j) for j in range(nv) for i in range(nu) if self.least(level, i, j) == level]
            columns += [self.one(level, i, j, truncate) for i, j in pairs]
        return np.stack(columns, axis=1)

    def one(self, level: int, i: int, j: int, truncate: bool) -> np.ndarray:
        nu, nv = (len(t) - self.degree - 1 for t in self.knots[level])
        c = np.zeros((nu, nv))
        c[i, j] = 1
        while truncate and level + 1 < len(self.knots):
            c = self.step(level, 0) @ c @ self.step(level, 1).T
            level += 1
            for a, b in zip(*c.nonzero(), strict=True):
                if self.least(level, int(a), int(b)) >= level:
                    c[a, b] = 0
        for axis in range(2):
            if (level, axis) not in self.grid:
                self.grid[level, axis] = self.functions(level, GRID[:, axis], axis)
        bu, bv = self.grid[level, 0], self.grid[level, 1]
        return np.einsum("mj,mj->m", bu @ c, bv)


def dyadic(levels: int, text: str = OPEN) -> list[list[np.ndarray]]:
    t = np.array([float(x) for x in text.split()])
    out = [[t, t]]
    for _ in range(levels - 1):
        t = np.sort(np.concatenate([t, (np.unique(t)[1:] + np.unique(t)[:-1]) / 2]))
        out.append([t, t])
    return out


CASES = {
    "the manual's example": [(1, 2, 2, 6, 6), (2, 4, 4, 10, 10)],
    "odd corners, skipped levels": [(2, 3, 5, 11, 16), (1, 0, 0, 3, 8)],
    "no box": [],
    "all refined": [(1, 0, 0, 8, 8)],
}


@pytest.mark.parametrize("kind", ["THBSpline", "HBSpline"])
@pytest.mark.parametrize("name", CASES)
def test_hierarchical_splines_are_taken_exactly(tmp_path: Path, kind: str, name: str) -> None:
    boxes = CASES[name]
    direct = Direct(dyadic(1 + max([b[0] for b in boxes], default=0)), 2, boxes)
    basis = direct.sampled(kind == "THBSpline")
    coefs = np.random.default_rng(3).normal(size=(basis.shape[1], 3))
    (item,) = read_surface(save(tmp_path, geometry(f"{kind}2", hierarchy(kind, boxes), coefs)))
    assert item.name == f"{kind}2 7"
    assert item.domain is None
    assert np.abs(item.surface.evaluate(GRID) - basis @ coefs).max() < 1e-11
    total = item.surface.basis_matrix(GRID).sum(axis=1)
    assert np.allclose(total, 1, atol=1e-12)


def test_the_manuals_example_has_the_manuals_numbers_and_few_points(tmp_path: Path) -> None:
    from surface.readers.thb import Hierarchy, Level, dyadic_refinement

    levels = [Level((2, 2), (np.array([float(x) for x in OPEN.split()]),) * 2)]
    levels += [dyadic_refinement(levels[0])]
    levels += [dyadic_refinement(levels[1])]
    depth = np.zeros((16, 16), dtype=np.int64)
    depth[4:12, 4:12] = 1
    depth[4:10, 4:10] = 2
    found = Hierarchy(levels, depth)
    assert np.bincount(found.active[:, 0]).tolist() == [36, 3, 16]  # G+Smo's manual, "THB-splines Tutorial"
    points, weights, ku, kv = found.control_points(np.ones((55, 3)))
    assert len(points) < 18 * 18  # not the finest level everywhere
    assert (weights > 0).all() and len(ku) == len(kv) == len(points)


def test_levels_given_one_by_one_may_repeat_knots(tmp_path: Path) -> None:
    finer = "0 0 0 0.1 0.25 0.25 0.5 0.6 0.75 0.9 1 1 1"
    base = tensor(extra='level="0"') + tensor(finer, finer, extra='level="1"')
    knots = [[np.array([float(x) for x in text.split()])] * 2 for text in (OPEN, finer)]
    boxes = [(1, 1, 1, 6, 5)]
    basis = Direct(knots, 2, boxes).sampled(True)
    coefs = np.random.default_rng(4).normal(size=(basis.shape[1], 2))
    text = geometry("THBSpline2", hierarchy("THBSpline", boxes, base, 'manualLevels="true"'), coefs)
    (item,) = read_surface(save(tmp_path, text))
    assert np.abs(item.surface.evaluate(GRID)[:, :2] - basis @ coefs).max() < 1e-11
    assert np.array_equal(item.surface.points[:, 2], np.zeros(item.surface.n))


def test_a_bilinear_patch_has_its_corners_where_the_file_says(tmp_path: Path) -> None:
    coefs = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [2, 3, 5.0]])
    text = "\n\n" + geometry("TensorBSpline2", tensor("0 0 1 1", "0 0 1 1", 1), coefs)
    (item,) = read_surface(save(tmp_path, text.replace('id="7"', 'id="7" label="roof"')))
    assert item.name == "roof"
    corners = item.surface.evaluate([[0, 0], [1, 0], [0, 1], [1, 1]])
    assert np.array_equal(corners, coefs)
    by_coordinate = geometry("TensorBSpline2", tensor("0 0 1 1", "0 0 1 1", 1), coefs, 'order="coordinates"')
    by_coordinate = by_coordinate.replace(
        "0.0 0.0 0.0\n2.0 0.0 0.0\n0.0 3.0 0.0\n2.0 3.0 5.0", "0 2 0 2 0 0 3 3 0 0 0 5"
    )
    (again,) = read_surface(save(tmp_path, by_coordinate))
    assert np.array_equal(again.surface.points, item.surface.points)


def test_uniform_knots_may_be_left_to_the_reader(tmp_path: Path) -> None:
    coefs = np.random.default_rng(6).normal(size=(36, 3))
    written = geometry("TensorBSpline2", tensor(), coefs)
    short = written.replace(f'degree="2">{OPEN}', 'degree="2" mode="uniform" csize="6">')
    assert short != written
    (a,), (b,) = (read_surface(save(tmp_path, text)) for text in (written, short))
    assert np.array_equal(a.surface.evaluate(GRID), b.surface.evaluate(GRID))


def quarter() -> str:
    """A quarter of a cylinder of radius 2."""
    coefs = np.array([[2, 0, 0], [2, 2, 0], [0, 2, 0], [2, 0, 1], [2, 2, 1], [0, 2, 1.0]])
    sides = tensor("0 0 0 1 1 1", "0 0 1 1").replace(
        'index="1">\n<KnotVector degree="2"', 'index="1">\n<KnotVector degree="1"'
    )
    w = 0.5**0.5
    basis = f'<Basis type="TensorNurbsBasis2">{sides}<weights>1 {w!r} 1 1 {w!r} 1</weights></Basis>'
    return geometry("TensorNurbs2", basis, coefs)


def test_a_rational_quarter_cylinder_is_round(tmp_path: Path) -> None:
    (item,) = read_surface(save(tmp_path, quarter()))
    xyz = item.surface.evaluate(GRID)
    assert np.allclose(np.hypot(xyz[:, 0], xyz[:, 1]), 2, rtol=0, atol=1e-14)
    assert np.allclose(xyz[:, 2], GRID[:, 1], rtol=0, atol=1e-15)


def test_open_ends_are_cut_off_by_the_domain(tmp_path: Path) -> None:
    coefs = np.random.default_rng(5).normal(size=(16, 3))
    text = geometry("TensorBSpline2", tensor("0 1 2 3 4 5 6", "0 1 2 3 4 5 6"), coefs)
    (item,) = read_surface(save(tmp_path, text))
    assert item.domain is not None
    assert item.domain.rect == (2, 4, 2, 4)


THB = geometry("THBSpline2", hierarchy("THBSpline", [(1, 2, 2, 6, 6)]), np.zeros((40, 3)))
SIDE = '<Basis type="BSplineBasis" index="0">'
FLAT = geometry("TensorBSpline2", tensor(), np.zeros((36, 3)))
BAD = {
    "truncated": (FLAT[:-40], "is not XML"),
    "empty": ("", "is not XML: no element found"),
    "entity": ('<!DOCTYPE x [<!ENTITY a "b">]><xml>&a;</xml>', "line 1.*entity"),
    "root": ("<svg/>", "line 1 <svg>.*must be <xml>"),
    "none": ("<xml></xml>", "holds no surface"),
    "kind": (FLAT.replace("TensorBSpline2", "TrimmedSurface"), "line 3 <Geometry>.*no surface omote reads"),
    "type": (FLAT.replace('type="TensorBSpline2"', ""), 'line 3 <Geometry>.*no attribute "type"'),
    "rational hierarchy": (THB.replace("THBSpline", "RationalTHBSpline"), 'type="RationalTHBSpline2" is no surface'),
    "periodic": (FLAT.replace('KnotVector degree="2"', 'KnotVector periodic="0" degree="2"', 1), "line 6 .*periodic"),
    "periodic side": (FLAT.replace('index="1"', 'index="1" periodic="true"', 1), "line 7 <Basis>: is periodic"),
    "uniform": (FLAT.replace("Vector degree", 'Vector mode="uniform" csize="2" degree', 1), 'csize="2" must be'),
    "transform": (FLAT.replace("<coefs", "<transform/><coefs"), "transform"),
    "NaN": (FLAT.replace("0.0 0.0 0.0\n", "0.0 nan 0.0\n", 1), "<coefs>: holds nan"),
    "word": (FLAT.replace("0.0 0.0 0.0\n", "0.0 x 0.0\n", 1), "<coefs>: holds what is not a number"),
    "count": (FLAT.replace("0.0 0.0 0.0\n", "", 1), "<coefs>: holds 105 numbers, needs 108"),
    "geoDim": (FLAT.replace('geoDim="3"', 'geoDim="4"'), "geoDim=4"),
    "geoDim word": (FLAT.replace('geoDim="3"', 'geoDim="x"'), 'geoDim="x" must be a whole number'),
    "base64": (FLAT.replace("<coefs", '<coefs format="B64Float64"'), "B64Float64"),
    "coefs": (FLAT.replace("coefs", "cfs"), "has no <coefs>"),
    "decreasing": (FLAT.replace("0.25 0.5 0.75", "0.5 0.25 0.75", 1), "line 6 <KnotVector>: knots decrease at knot 4"),
    "repeated": (FLAT.replace("0.25 0.5 0.75", "0 0.5 0.75", 1), "more than 3 times"),
    "short": (FLAT.replace(OPEN, "0 0 1", 1), "holds 3 knots"),
    "degree": (FLAT.replace('degree="2"', 'degree="10"', 1), 'degree="10"'),
    "sides": (FLAT.replace(SIDE, "<B>").replace("</Basis>", "</B>", 1), "has 1 directions"),
    "weights": (quarter().replace("<weights>1", "<weights>-1"), r"<weights>: weights\[0\]: must be positive"),
    "box": (THB.replace(">2 2 6 6", ">2 2 6 9"), "line 11 <box>: reaches from 2 to 9"),
    "box level": (THB.replace('level="1"', 'level="99"'), 'level="99"'),
    "box numbers": (THB.replace(">2 2 6 6", ">2 2 6"), "<box>: holds 3 numbers, needs 4"),
    "functions": (THB.replace(">2 2 6 6", ">2 2 7 6"), "<coefs>: holds 120 numbers"),
    "level missing": (THB.replace('Basis2" >\n<Basis', 'Basis2" manualLevels="true">\n<Basis', 1), "gives 1 levels"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_every_damage_is_one_clear_error(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    with pytest.raises(SurfaceFileError, match=message) as caught:
        read_surface(save(tmp_path, text))
    assert "a.xml" in str(caught.value)
    assert caught.value.hint


def test_levels_that_are_not_nested_are_refused(tmp_path: Path) -> None:
    finer = "0 0 0 0.3 0.5 0.75 1 1 1"
    base = tensor() + tensor(finer, finer)
    text = geometry(
        "THBSpline2", hierarchy("THBSpline", [(1, 0, 0, 4, 4)], base, 'manualLevels="true"'), np.zeros((4, 3))
    )
    with pytest.raises(SurfaceFileError, match="not nested"):
        read_surface(save(tmp_path, text))


@pytest.mark.parametrize("before", [0, 3])
def test_lines_are_counted_from_the_first_one_of_the_file(tmp_path: Path, before: int) -> None:
    """G+Smo writes empty lines before the declaration, too."""
    good = geometry("TensorBSpline2", tensor(), np.zeros((36, 3)))
    damage = (
        (good.replace("</Geometry>", "</Geometrie>"), "is not XML"),
        (good.replace("<xml>", '<!DOCTYPE xml [<!ENTITY a "b">]><xml>'), "declares an entity"),
        (good.replace('degree="2"', 'degree="x"', 1), "must be a whole number"),
    )
    for text, why in damage:
        with pytest.raises(SurfaceFileError, match=why) as caught:
            read_surface(save(tmp_path, "\n" * before + text))
        changed = next(
            k for k, (a, b) in enumerate(zip(good.splitlines(), text.splitlines(), strict=True), 1) if a != b
        )
        assert f"line {changed + before}" in str(caught.value)


@pytest.mark.parametrize(("dimension", "fits"), [(1, False), (2, True), (3, True), (4, False), (9, False), (10, False)])
def test_surfaces_are_in_the_plane_or_in_space(tmp_path: Path, dimension: int, fits: bool) -> None:
    text = geometry("TensorBSpline2", tensor(), np.ones((36, dimension)))
    if fits:
        assert (read_surface(save(tmp_path, text))[0].surface.points[:, :dimension] == 1).all()
        return
    with pytest.raises(SurfaceFileError, match="geoDim"):
        read_surface(save(tmp_path, text))


def test_whole_numbers_may_be_their_limits(tmp_path: Path) -> None:
    element = gismo.Element("a", {"n": "3", "word": "x", "minus": "-1", "spaced": " 4 "})
    element.location = Location(tmp_path / "a.xml")
    assert element.integer("n", 3, 3) == 3 and element.integer("n", 0, 3) == 3 and element.integer("n", 3, 9) == 3
    assert element.integer("spaced", 0, 9) == 4
    for name, low, high in (("n", 4, 9), ("n", 0, 2), ("word", 0, 9), ("minus", -5, 9)):
        with pytest.raises(SurfaceFileError, match=f"must be a whole number from {low} to {high}"):
            element.integer(name, low, high)


def test_knots_nearer_than_can_be_told_apart_are_refused(tmp_path: Path) -> None:
    """Near is meant in parts of the whole, however large the numbers are."""
    for scale in (1e-3, 1.0, 1e3):
        for gap, fits in ((0.9 * gismo.CLOSE, False), (1.1 * gismo.CLOSE, True)):
            knots = np.array([0, 0, 0, 0.5, 0.5 + gap, 1, 1, 1]) * scale
            text = tensor(" ".join(repr(float(x)) for x in knots))
            text = geometry("TensorBSpline2", text, np.zeros((30, 3)))
            if fits:
                read_surface(save(tmp_path, text))
            else:
                with pytest.raises(SurfaceFileError, match="knots 3 and 4 are too close"):
                    read_surface(save(tmp_path, text))


def test_a_finest_level_with_too_many_functions_is_refused(tmp_path: Path) -> None:
    """Four spans quartered eleven times are 8192 each way: 2^26 functions, where each direction alone is few."""
    text = geometry("THBSpline2", hierarchy("THBSpline", [(11, 0, 0, 4, 4)]), np.zeros((36, 3)))
    with pytest.raises(SurfaceFileError, match=r"its finest level has \d+ x \d+ functions, more than 16777216"):
        read_surface(save(tmp_path, text))
