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


def test_every_type_of_number_has_its_size_and_both_its_names(tmp_path: Path) -> None:
    """Turk's names and those of the sizes, in both byte orders; numpy packs the row."""
    kinds = ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"]
    sized = ["int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"]
    codes = ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"]
    for names in (kinds, sized):
        for order, form in (("<", "binary_little_endian"), (">", "binary_big_endian")):
            row = np.array([(-7, 250, -30_000, 60_000, -70_000, 4_000_000_000, 0.5, 1e-300)],
                           [(f"p{k}", order + code) for k, code in enumerate(codes)])  # fmt: skip
            lines = [f"property {name} p{k}" for k, name in enumerate(names)]
            head = "\n".join(["ply", f"format {form} 1.0", "element e 1", *lines, "end_header", ""])
            (tmp_path / "a.ply").write_bytes(head.encode() + row.tobytes())
            found = PlyFile(tmp_path / "a.ply").elements["e"].numbers
            assert [found[f"p{k}"][0] for k in range(8)] == list(row[0])


@pytest.mark.parametrize("lengths", [[3, 3, 3], [3, 0, 4], [0, 0, 0], []])
def test_rows_with_lists_of_even_and_of_uneven_lengths_are_read_alike(tmp_path: Path, lengths: list[int]) -> None:
    """With a number before and after the list, and another element behind."""
    rng = np.random.default_rng(sum(lengths))
    rows = [rng.integers(0, 1000, n).tolist() for n in lengths]
    head = (f"ply\nformat {{}} 1.0\nelement face {len(rows)}\nproperty uchar kind\nproperty list ushort int v\n"
            "property float size\nelement last 1\nproperty int x\nend_header\n")  # fmt: skip
    data = b"".join(struct.pack(f">BH{len(row)}if", k, len(row), *row, 0.25 * k) for k, row in enumerate(rows))
    binary_file = head.format("binary_big_endian").encode() + data + struct.pack(">i", -42)
    words = [f"{k} {len(row)} {' '.join(map(str, row))} {0.25 * k}" for k, row in enumerate(rows)]
    text_file = head.format("ascii").encode() + "\n".join([*words, "-42\n"]).encode()
    for content in (binary_file, text_file):
        (tmp_path / "a.ply").write_bytes(content)
        face, last = PlyFile(tmp_path / "a.ply").elements.values()
        flat, starts = face.lists["v"]
        assert flat.tolist() == [x for row in rows for x in row]
        assert starts.tolist() == np.cumsum([0, *lengths]).tolist()
        assert face.numbers["kind"].tolist() == list(range(len(rows)))
        assert face.numbers["size"].tolist() == [0.25 * k for k in range(len(rows))]
        assert last.numbers["x"].tolist() == [-42]


def test_more_properties_than_any_file_has_are_refused(tmp_path: Path) -> None:
    for count, good in ((64, True), (65, False)):
        lines = "".join(f"property int p{k}\n" for k in range(count))
        (tmp_path / "a.ply").write_text(f"ply\nformat ascii 1.0\nelement e 0\n{lines}end_header\n")
        if good:
            assert len(PlyFile(tmp_path / "a.ply").elements["e"].properties) == 64
        else:
            with pytest.raises(FitError, match="property 'p64' is out of place"):
                PlyFile(tmp_path / "a.ply")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("plx\nformat ascii 1.0\nend_header\n", "it does not begin with ply"),
        ("ply\nformat ascii 1.0\n", "it has no end_header"),
        ("ply\nformat ascii 1.0\nend_header", "it has no end_header"),
        ("ply\nelement e 0\nend_header\n", "it names no format"),
        ("ply\nformat middle_endian 1.0\nend_header\n", "'format middle_endian 1.0' is no line of it"),
        ("ply\nformat ascii 1.0\nelement e 2\nproperty int x\nend_header\n1\n", "element e: the file is cut short"),
        (
            "ply\nformat ascii 1.0\nelement e 1\nproperty int x\nend_header\none\n",
            "element e: is damaged: a word in it",
        ),
        ("ply\nformat ascii 1.0\nproperty int x\nend_header\n", "property 'x' is out of place"),
    ],
)
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "a.ply").write_text(content)
    with pytest.raises(FitError) as caught:
        PlyFile(tmp_path / "a.ply")
    assert said in str(caught.value) and caught.value.hint == "save the mesh again as .ply or .obj"
