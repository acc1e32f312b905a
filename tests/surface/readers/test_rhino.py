"""openNURBS files written by rhino3dm: the same surface as openNURBS evaluates, trims, damage."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface import SurfaceError, SurfaceFileError
from surface.readers import NamedSurface, read_surface
from surface.readers import rhino as reader
from surface.readers.common import Location


@pytest.fixture(scope="module")
def rhino() -> Any:
    return pytest.importorskip("rhino3dm", reason="writing .3dm files to read needs rhino3dm: pip install rhino3dm")


def saved(tmp_path: Path, rhino: Any, *shapes: Any, name: str = "") -> list[NamedSurface]:
    file = rhino.File3dm()
    attributes = rhino.ObjectAttributes()
    attributes.Name = name
    for shape in shapes:
        file.Objects.Add(shape, attributes)
    path = tmp_path / "a.3dm"
    assert file.Write(str(path), 7)
    return read_surface(path)


def net(rhino: Any, rational: bool = True, counts: tuple[int, int] = (6, 5), orders: tuple[int, int] = (4, 3)) -> Any:
    """A wavy surface with uneven knots."""
    rng = np.random.default_rng(2)
    form = rhino.NurbsSurface.Create(3, rational, *orders, *counts)
    for knots, count, order in ((form.KnotsU, counts[0], orders[0]), (form.KnotsV, counts[1], orders[1])):
        knots.CreateUniformKnots(1.0)
        for k in range(order - 1, count - 1):
            knots[k] = knots[k] + rng.uniform(-0.3, 0.3)
    for i in range(counts[0]):
        for j in range(counts[1]):
            w = rng.uniform(0.5, 2) if rational else 1.0
            form.Points[(i, j)] = rhino.Point4d(i * w, j * w, rng.normal() * w, w)
    return form


def check(item: NamedSurface, form: Any) -> None:
    """Positions as openNURBS evaluates them."""
    rect = item.domain.rect if item.domain is not None else item.surface.rect
    assert rect == (form.Domain(0).T0, form.Domain(0).T1, form.Domain(1).T0, form.Domain(1).T1)
    uv = np.random.default_rng(3).uniform(0, 1, (200, 2)) * [rect[1] - rect[0], rect[3] - rect[2]] + [rect[0], rect[2]]
    uv = np.vstack([uv, [[rect[0], rect[2]], [rect[1], rect[3]]]])
    want = np.array([[p.X, p.Y, p.Z] for p in (form.PointAt(*x) for x in uv)])
    assert np.abs(item.surface.evaluate(uv) - want).max() < 1e-13 * max(1.0, np.abs(want).max())


@pytest.mark.parametrize("rational", [True, False])
def test_nurbs_surfaces_come_back_exactly(tmp_path: Path, rhino: Any, rational: bool) -> None:
    form = net(rhino, rational)
    (item,) = saved(tmp_path, rhino, form, name="cheek")
    assert item.name == "cheek"
    assert item.domain is None
    assert item.surface.degrees[0].tolist() == [3] * 30
    check(item, form)


def test_a_sphere_is_round_and_untrimmed(tmp_path: Path, rhino: Any) -> None:
    (item,) = saved(tmp_path, rhino, rhino.Brep.CreateFromSphere(rhino.Sphere(rhino.Point3d(1, 2, 3), 2.0)))
    assert item.domain is None
    u0, u1, v0, v1 = item.surface.rect
    uv = np.random.default_rng(4).uniform([u0, v0], [u1, v1], (300, 2))
    assert np.allclose(np.linalg.norm(item.surface.evaluate(uv) - [1, 2, 3], axis=1), 2, rtol=0, atol=1e-13)


def test_a_box_has_six_named_faces(tmp_path: Path, rhino: Any) -> None:
    box = rhino.Brep.CreateFromBoundingBox(rhino.BoundingBox(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 2, 3)))
    items = saved(tmp_path, rhino, box, name="box")
    assert [item.name for item in items] == [f"box face {k}" for k in range(6)]
    corners = np.concatenate([item.surface.points for item in items])
    assert np.array_equal(
        np.unique(corners.round(12), axis=0), [[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)]
    )
    assert all(item.domain is None for item in items)


def test_a_trimmed_disc_keeps_its_outline(tmp_path: Path, rhino: Any) -> None:
    plane = rhino.Plane(rhino.Point3d(5, 0, 1), rhino.Vector3d(0, 0, 1))
    outline = rhino.Circle(rhino.Point3d(5, 0, 1), 2.0).ToNurbsCurve()
    (item,) = saved(tmp_path, rhino, rhino.Brep.CreateTrimmedPlane(plane, outline))
    assert item.domain is not None
    (loop,) = item.domain.loops
    radii = np.linalg.norm(item.surface.evaluate(loop) - [5, 0, 1], axis=1)
    assert np.allclose(radii, 2, rtol=0, atol=1e-9)
    assert 4 * np.pi * (1 - 1e-3) < item.domain.area < 4 * np.pi
    mesh = item.surface.tessellate(domain=item.domain, loop_error=1e-3)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(4 * np.pi, rel=3e-3)


def test_a_periodic_surface_is_closed(tmp_path: Path, rhino: Any) -> None:
    form = rhino.NurbsSurface.Create(3, False, 4, 4, 11, 4)
    form.KnotsU.CreatePeriodicKnots(1.0)
    form.KnotsV.CreateUniformKnots(1.0)
    for i in range(11):
        for j in range(4):
            angle = 2 * np.pi * (i % 8) / 8
            form.Points[(i, j)] = rhino.Point4d(np.cos(angle), np.sin(angle), j, 1.0)
    (item,) = saved(tmp_path, rhino, form)
    assert form.IsPeriodic(0)
    assert item.surface.closed[0] == (form.Domain(0).T0, form.Domain(0).T1)
    assert item.surface.n == 8 * 4
    check(item, form)


@pytest.mark.parametrize(("rational", "order"), [(False, 3), (True, 4), (True, 5), (False, 7)])
def test_an_uneven_closed_surface_comes_back_exactly(tmp_path: Path, rhino: Any, rational: bool, order: int) -> None:
    """The knots that openNURBS leaves out follow from those a turn further on, however uneven they are."""
    degree, rng = order - 1, np.random.default_rng(order)
    spans = rng.uniform(0.2, 1.8, 8)
    knots = np.concatenate([[0.0], np.cumsum(np.tile(spans, 3))])[8 - degree + 1 :][: 8 + 2 * degree - 1]
    form = rhino.NurbsSurface.Create(3, rational, order, 2, 8 + degree, 2)
    for k, knot in enumerate(knots):
        form.KnotsU[k] = float(knot)
    form.KnotsV.CreateUniformKnots(1.0)
    ring = [rng.normal(size=3) + np.array([3 * np.cos(i), 3 * np.sin(i), 0]) for i in range(8)]
    weights = rng.uniform(0.5, 2, 8) if rational else np.ones(8)
    for i in range(8 + degree):
        for j in range(2):
            w, (x, y, z) = weights[i % 8], ring[i % 8]
            form.Points[(i, j)] = rhino.Point4d(x * w, y * w, (z + j) * w, w)
    (item,) = saved(tmp_path, rhino, form)
    assert form.IsPeriodic(0)
    assert item.surface.closed[0] is not None
    check(item, form)


def test_a_bad_object_is_left_out_by_name_and_the_others_are_read(tmp_path: Path, rhino: Any) -> None:
    bad = net(rhino)
    bad.Points[(1, 1)] = rhino.Point4d(0, 0, 0, -1.0)
    with pytest.raises(SurfaceFileError, match=r"object 1 \("):
        saved(tmp_path, rhino, net(rhino), bad, net(rhino, False))
    left_out: list[SurfaceFileError] = []
    items = read_surface(tmp_path / "a.3dm", left_out.append)
    assert [item.name for item in items] == ["object 0", "object 2"]
    assert len(left_out) == 1
    assert "object 1 (" in str(left_out[0])


def test_a_bad_face_is_left_out_and_the_other_faces_are_read(
    tmp_path: Path, rhino: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = rhino.Brep.CreateFromBoundingBox(rhino.BoundingBox(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 2, 3)))
    saved(tmp_path, rhino, box, name="box")
    whole = reader._face

    def face(here: Location, *parts: Any) -> Any:
        if here.where.endswith("face 4"):
            raise here.error("is torn")
        return whole(here, *parts)

    monkeypatch.setattr(reader, "_face", face)
    left_out: list[SurfaceFileError] = []
    items = read_surface(tmp_path / "a.3dm", left_out.append)
    assert [item.name for item in items] == [f"box face {k}" for k in (0, 1, 2, 3, 5)]
    assert [str(error).split(", ")[-1] for error in left_out] == ["face 4: is torn"]


def test_an_extrusion_is_its_faces(tmp_path: Path, rhino: Any) -> None:
    cylinder = rhino.Cylinder(rhino.Circle(rhino.Point3d(0, 0, 0), 1.5), 4.0)
    items = saved(tmp_path, rhino, rhino.Extrusion.CreateCylinderExtrusion(cylinder, True, True))
    assert len(items) == 3
    radii = [np.hypot(*item.surface.evaluate(np.array([middle(item)]))[0, :2]) for item in items]
    assert sorted(np.round(radii, 9).tolist()) == [0, 0, 1.5]
    assert sum(item.domain is not None for item in items) == 2  # two caps, each a trimmed plane


def middle(item: NamedSurface) -> tuple[float, float]:
    u0, u1, v0, v1 = item.surface.rect
    return (u0 + u1) / 2, (v0 + v1) / 2


def test_curves_are_left_out_and_alone_are_no_surface(tmp_path: Path, rhino: Any) -> None:
    line = rhino.LineCurve(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 0, 0))
    with pytest.raises(SurfaceFileError, match="holds no surface"):
        saved(tmp_path, rhino, line)
    assert len(saved(tmp_path, rhino, line, net(rhino))) == 1


def test_damaged_files_are_one_clear_error(tmp_path: Path, rhino: Any) -> None:
    saved(tmp_path, rhino, net(rhino))
    data = (tmp_path / "a.3dm").read_bytes()
    for bad in (b"", b"hello", data[: len(data) // 2]):
        (tmp_path / "b.3dm").write_bytes(bad)
        with pytest.raises(SurfaceFileError, match=r"b\.3dm: is no openNURBS file") as caught:
            read_surface(tmp_path / "b.3dm")
        assert caught.value.hint
    with pytest.raises(SurfaceFileError, match="cannot be read"):
        read_surface(tmp_path / "none.3dm")


def test_weights_and_numbers_that_no_surface_can_have_are_named(tmp_path: Path, rhino: Any) -> None:
    for values in ((0, 0, 0, -1.0), (np.nan, 0, 0, 1.0)):
        form = net(rhino)
        form.Points[(1, 1)] = rhino.Point4d(*values)
        with pytest.raises(SurfaceFileError, match=r"object 0 \(.*(not valid|control point \(1, 1\) is)"):
            saved(tmp_path, rhino, form)


class Valid:
    """A surface that says that it is valid, whatever its points are."""

    IsValid = True

    def __init__(self, form: Any) -> None:
        self.ToNurbsSurface = lambda: form


@pytest.mark.parametrize("values", [(0, 0, 0, 0.0), (0, 0, 0, -1.0), (np.inf, 0, 0, 1.0), (0, 0, 0, np.nan)])
def test_a_point_without_place_or_weight_is_named(tmp_path: Path, rhino: Any, values: tuple[float, ...]) -> None:
    form = net(rhino)
    form.Points[(2, 3)] = rhino.Point4d(*values)
    with pytest.raises(SurfaceFileError, match=r"control point \(2, 3\) is \[.*not finite, or no positive weight"):
        reader._nurbs(Location(tmp_path / "a.3dm"), Valid(form))


def test_edges_run_as_their_trims_do_and_a_pole_has_none() -> None:
    edge = SimpleNamespace(
        Domain=SimpleNamespace(T0=2.0, T1=5.0), PointAt=lambda t: SimpleNamespace(X=t, Y=2.0 * t, Z=-t)
    )
    trims = [SimpleNamespace(EdgeIndex=k, IsReversed=r) for k, r in ((0, False), (-1, False), (0, True))]
    loop = SimpleNamespace(TrimCount=3, Trims=trims)
    there, pole, back = reader._edges(SimpleNamespace(Edges=[edge]), loop, 1e-3)
    assert pole.points.shape == (0, 3)
    np.testing.assert_allclose(there.points[[0, -1]], [[2.0, 4.0, -2.0], [5.0, 10.0, -5.0]])
    np.testing.assert_array_equal(back.points, there.points[::-1])


@pytest.mark.parametrize(("off", "along"), [(0.0, True), (3e-7, True), (5e-7, False)])
def test_a_loop_on_the_rectangles_border_trims_nothing(off: float, along: bool) -> None:
    """Within 1e-7 of its longer side, which is 4 here."""
    loop = np.array([[1.0, 2.0], [4.0, 2.0], [4.0 + off, 3.0], [2.0, 6.0], [1.0, 6.0]])
    assert reader._along_border(loop, (1.0, 4.0, 2.0, 6.0)) == along


def test_without_rhino3dm_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rhino3dm", None)
    (tmp_path / "a.3dm").write_bytes(b"")
    with pytest.raises(SurfaceError, match=r"a\.3dm.*rhino3dm") as caught:
        read_surface(tmp_path / "a.3dm")
    assert caught.value.hint == "pip install 'omote[cad]'"


def test_what_keeps_opennurbs_busy_is_refused_within_a_limit(
    tmp_path: Path, rhino: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved(tmp_path, rhino, net(rhino))
    monkeypatch.setattr(
        reader, "TRIAL", reader.TRIAL.replace("import sys, rhino3dm", "import sys").split("sys.exit")[0]
    )
    monkeypatch.setattr(reader, "TRIAL", reader.TRIAL + "while True: pass")
    monkeypatch.setattr(reader, "PATIENCE_S", 0.05)
    with pytest.raises(SurfaceFileError, match="is no openNURBS file, or a damaged one"):
        read_surface(tmp_path / "a.3dm")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not bound the memory of a process so")
def test_what_makes_opennurbs_ask_for_gigabytes_is_refused_within_a_limit(
    tmp_path: Path, rhino: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved(tmp_path, rhino, net(rhino))
    assert read_surface(tmp_path / "a.3dm")
    asks = "held = bytes(int(sys.argv[2]) + 1)\n"
    monkeypatch.setattr(reader, "TRIAL", reader.TRIAL.replace("sys.exit", asks + "sys.exit"))
    with pytest.raises(SurfaceFileError, match="is no openNURBS file, or a damaged one"):
        read_surface(tmp_path / "a.3dm")


def test_a_crash_of_opennurbs_ends_only_the_trial(tmp_path: Path, rhino: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    saved(tmp_path, rhino, net(rhino))
    monkeypatch.setattr(reader, "TRIAL", "import os; os.abort()")
    with pytest.raises(SurfaceFileError, match="is no openNURBS file, or a damaged one"):
        read_surface(tmp_path / "a.3dm")
