"""surface.readers.ply.rows: numbers and lists in every form, against numpy, struct and trimesh."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from surface.base.errors import FitError
from surface.readers.ply.rows import PlyFile

HEAD = """ply
format {form} 1.0
comment made by hand
obj_info num_cols 3
element vertex 2
property short id
property double x
property uchar grey
element tristrips 1
property list uint8 int vertex_indices
element cells 2
property list uchar float weights
property ushort kind
end_header
"""
IDS, XS, GREYS, STRIP = [-3, 7], [0.1, -2.5e-9], [0, 255], [0, 1, -1, 1, 0]
WEIGHTS, KINDS = [[0.5, 0.25], []], [65535, 1]


def text() -> bytes:
    rows = [f"{i} {x!r} {g}" for i, x, g in zip(IDS, XS, GREYS, strict=True)]
    rows += ["5 0 1 -1 1 0", "2 0.5 0.25 65535", "0 1"]
    return (HEAD.format(form="ascii") + "\n".join(rows) + "\n").encode()


def binary(order: str) -> bytes:
    form = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    data = HEAD.format(form=form).encode()
    for row in zip(IDS, XS, GREYS, strict=True):
        data += struct.pack(order + "hdB", *row)
    data += struct.pack(order + "B5i", 5, *STRIP)
    for weights, kind in zip(WEIGHTS, KINDS, strict=True):
        data += struct.pack(order + f"B{len(weights)}fH", len(weights), *weights, kind)
    return data


@pytest.mark.parametrize("data", [text(), binary("<"), binary(">")], ids=["ascii", "little", "big"])
def test_numbers_and_lists_are_read_in_every_form(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(data)
    file = PlyFile(path)
    assert file.comments == ["made by hand", "num_cols 3"]
    vertex, strips, cells = (file.elements[name] for name in ("vertex", "tristrips", "cells"))
    assert vertex.columns("id", "x", "grey") == pytest.approx(np.column_stack([IDS, XS, GREYS]), rel=1e-15)
    assert vertex.columns("id", "y") is None
    flat, starts = strips.lists["vertex_indices"]
    assert (flat.tolist(), starts.tolist()) == (STRIP, [0, 5])
    flat, starts = cells.lists["weights"]
    assert (flat.tolist(), starts.tolist()) == ([0.5, 0.25], [0, 2, 2])
    assert cells.numbers["kind"].tolist() == KINDS


@pytest.mark.parametrize("order", ["<", ">"])
def test_every_cut_of_a_binary_file_is_named(tmp_path: Path, order: str) -> None:
    data, path = binary(order), tmp_path / "a.ply"
    for end in range(data.index(b"end_header") + 11, len(data)):
        path.write_bytes(data[:end])
        with pytest.raises(FitError, match=r"a\.ply: element \w+: the file is cut short: it says \d rows"):
            PlyFile(path)


def test_a_count_that_is_negative_or_beyond_the_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    head = "ply\nformat ascii 1.0\nelement face 1\nproperty list char int v\nend_header\n"
    for row in ("-1 4", "9 1 2", "1"):
        path.write_text(head + row + "\n")
        with pytest.raises(FitError, match="element face"):
            PlyFile(path)
    path.write_bytes(head.replace("ascii", "binary_little_endian").encode() + b"\xff\0\0\0\0")
    with pytest.raises(FitError, match="element face"):
        PlyFile(path)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("property list float int v", "is no line of it"),
        ("property half x", "is no line of it"),
        ("element vertex 99999999999999", "is no line of it"),
        ("element vertex -1", "is no line of it"),
        ("nonsense", "is no line of it"),
        ("property int x", "property 'x' is out of place"),
        ("element e 0\nproperty int x\nproperty int x", "property 'x' is out of place"),
    ],
)
def test_a_line_of_the_header_that_is_wrong_is_shown(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "a.ply"
    path.write_text(f"ply\nformat ascii 1.0\n{line}\nend_header\n")
    with pytest.raises(FitError, match=said):
        PlyFile(path)


def test_an_element_called_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_text("ply\nformat ascii 1.0\nelement a 0\nelement a 0\nend_header\n")
    with pytest.raises(FitError, match="element a 0"):
        PlyFile(path)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_what_trimesh_writes_is_read(tmp_path: Path, encoding: str) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    path = tmp_path / "ball.ply"
    path.write_bytes(trimesh.exchange.ply.export_ply(mesh, encoding=encoding))
    file = PlyFile(path)
    flat, starts = file.elements["face"].lists["vertex_indices"]
    assert (np.diff(starts) == 3).all()
    assert flat.reshape(-1, 3).tolist() == mesh.faces.tolist()
    assert file.elements["vertex"].columns("x", "y", "z") == pytest.approx(mesh.vertices, abs=1e-6)
