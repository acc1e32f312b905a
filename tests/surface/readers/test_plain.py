"""omote's own surface files: exact round trips, and one clear error for every damage."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from surface import DCPSurface, Domain, Slit, SurfaceFileError
from surface.readers import NamedSurface, read_surface, write_surfaces
from tests.surface import shapes


def same(a: DCPSurface, b: DCPSurface) -> bool:
    pairs = [(a.points, b.points), (a.weights, b.weights), *zip(a.padded, b.padded, strict=True)]
    pairs += list(zip(a.degrees, b.degrees, strict=True))
    return all(np.array_equal(x, y) for x, y in pairs) and a.closed == b.closed


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10_000))
def test_a_round_trip_keeps_every_bit(tmp_path: Path, seed: int) -> None:
    surface = shapes.scattered(12, seed, degrees=(0, 9))
    file = tmp_path / "a.json"
    write_surfaces(file, [NamedSurface("scattered", surface), NamedSurface("ü", shapes.hills(6))])
    first, second = read_surface(file)
    assert (first.name, second.name) == ("scattered", "ü")
    assert first.domain is None
    assert same(first.surface, surface)
    assert same(second.surface, shapes.hills(6))


def test_domains_slits_and_closed_directions_come_back(tmp_path: Path) -> None:
    torn = shapes.hills(8)
    closed = DCPSurface(torn.points, torn.weights, torn.knots_u, torn.knots_v, closed_u=(0, 1))
    domain = Domain((0, 1, 0.1, 0.9), shapes.face_like().loops, [Slit("u", 0.5, 0.2, 1 / 3)])
    file = tmp_path / "a.json"
    write_surfaces(file, [NamedSurface("a", closed, domain)])
    (back,) = read_surface(file)
    assert same(back.surface, closed)
    assert back.domain is not None
    assert back.domain.rect == domain.rect
    assert back.domain.slits == domain.slits
    assert np.array_equal(back.domain.segments, domain.segments)


def test_weight_and_degree_may_be_left_out(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    table = good()
    del table["surfaces"][0]["points"][0]["weight"], table["surfaces"][0]["points"][0]["degree"]
    file.write_text(json.dumps(table))
    assert read_surface(file)[0].surface.weights.tolist() == [1.0]


def good() -> dict[str, Any]:
    point = {"position": [1, 2, 3], "weight": 2, "degree": [1, 2], "knots_u": [0, 1, 2], "knots_v": [0, 1, 2, 3]}
    domain = {"rect": [0, 1, 0, 1], "loops": [], "slits": [{"axis": "u", "at": 0.5, "start": 0, "end": 1}]}
    row = {"name": "a", "points": [point], "domain": domain}
    return {"format": "omote surface", "version": 1, "surfaces": [row]}


def damage(change: Callable[[dict, dict], object]) -> str:
    table = good()
    change(table, table["surfaces"][0])
    return json.dumps(table)


BAD = {
    "truncated": (json.dumps(good())[:-30], "line 1, column"),
    "NaN": ('{"format": "omote surface",\n"version": NaN}', "line 2: NaN"),
    "binary": ("\x00\x01", "line 1, column 1"),
    "nested": ("[" * 200_000, "nested too deeply"),
    "no format": ("{}", '"format" must be'),
    "version": (damage(lambda t, s: t.update(version=2)), "version: must be 1"),
    "none": (damage(lambda t, s: t.update(surfaces=[])), "holds no surface"),
    "surfaces": (damage(lambda t, s: t.pop("surfaces")), "surfaces: is missing"),
    "surface": (damage(lambda t, s: t.update(surfaces=[3])), r"surfaces\[0\]: must be a table"),
    "points": (damage(lambda t, s: s.update(points={})), r"surfaces\[0\].points: must be a list"),
    "empty": (damage(lambda t, s: s.update(points=[])), "points"),
    "point": (damage(lambda t, s: s.update(points=[3])), r"points\[0\]: must be a table"),
    "position": (damage(lambda t, s: s["points"][0].pop("position")), r'points\[0\]: has no "position"'),
    "count": (damage(lambda t, s: s["points"][0].update(position=[1, 2])), r"points\[0\].position: must be 3"),
    "text": (damage(lambda t, s: s["points"][0].update(knots_u=["a"])), r"points\[0\].knots_u: must be degree"),
    "weight": (damage(lambda t, s: s["points"][0].update(weight=-1)), r"weights\[0\]"),
    "huge": (damage(lambda t, s: s["points"][0].update(weight=7)).replace("7", "1e999"), r"points\[0\].weight"),
    "degree": (damage(lambda t, s: s["points"][0].update(degree=[3, 3])), r"points\[0\].degree"),
    "knots": (damage(lambda t, s: s["points"][0].update(knots_u=[0, 2, 1])), r"knots_u\[0\]: knots decrease"),
    "closed": (damage(lambda t, s: s.update(closed_u=[1])), r"closed_u: must be 2"),
    "domain": (damage(lambda t, s: s.update(domain=[])), r"surfaces\[0\].domain: must be a table"),
    "rect": (damage(lambda t, s: s["domain"].update(rect=[0, 0, 1, 1])), "domain: rect"),
    "loops": (damage(lambda t, s: s["domain"].update(loops=[[[0, 0], [1]]])), r"loops\[0\]\[1\]: must be 2"),
    "slit": (damage(lambda t, s: s["domain"].update(slits=[{"axis": "u"}])), r"slits\[0\]: must be a table"),
    "axis": (damage(lambda t, s: s["domain"]["slits"][0].update(axis="w")), "Slit.axis"),
}


@pytest.mark.parametrize("name", BAD)
def test_every_damage_is_one_clear_error(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(SurfaceFileError, match=message) as caught:
        read_surface(file)
    assert str(file) in str(caught.value)
    assert caught.value.hint


def test_missing_files_other_suffixes_and_bytes_are_named(tmp_path: Path) -> None:
    with pytest.raises(SurfaceFileError, match="cannot be read"):
        read_surface(tmp_path / "none.json")
    with pytest.raises(SurfaceFileError, match=r"ends in \.step"):
        read_surface(tmp_path / "a.step")
    (tmp_path / "b.json").write_bytes(b"\xff\xfe")
    with pytest.raises(SurfaceFileError, match="not UTF-8"):
        read_surface(tmp_path / "b.json")
    with pytest.raises(SurfaceFileError, match="cannot be written"):
        write_surfaces(tmp_path / "no" / "a.json", [])


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
def test_a_full_disk_leaves_the_surfaces_that_were_there(tmp_path: Path) -> None:
    import resource

    file = tmp_path / "a.json"
    write_surfaces(file, [NamedSurface("old", shapes.hills(4))])
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(SurfaceFileError, match="cannot be written"):
            write_surfaces(file, [NamedSurface("new", shapes.hills(8))])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [item.name for item in read_surface(file)] == ["old"] and list(tmp_path.iterdir()) == [file]
