"""Good files of bare scans, of landmarks on them, and of groups of a surface's control points."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.surfaces import SurfaceOptions, head_of
from surface.fit.transfer.reports.landmarkfile import read_landmarks
from surface.fit.transfer.scan import Scan, read_scan
from surface.readers.common import NamedSurface

MARKS = b"""[landmarks]
nose_tip = [20.0, 10.5, 35.0]
chin = 3
left_eye_inner = { vertex = 7 }
mouth_left = { point = [-20.0, 5.0, 10.0] }
mouth_right = { pixel = [40.0, 60.0] }
[picture]
turn = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
scale = 0.5
shift = [50.0, -50.0, 0.0]
"""
PICKED = b"""<!DOCTYPE PickedPoints><PickedPoints><DocumentData><DataFileName name="mesh.ply"/></DocumentData>
<point x="20" y="10.5" z="35" name="nose_tip" active="1"/><point x="-20" y="5" z="10" name="chin" active="1"/>
<point x="0" y="0" z="0" name="5" active="0"/></PickedPoints>
"""
GROUPS = b"""[[groups]]
name = "mouthSmileLeft"
at = [10.0, 0.0, 30.0]
radius = 60.0
move = [0.0, 5.0, 1.0]
mirror = "mouthSmileRight"
[[groups]]
name = "jawOpen"
at = [0.0, -10.0, 20.0]
radius = 40.0
hinge = [0.0, 0.0, -50.0]
axis = [1.0, 0.0, 0.0]
angle_deg = 12.0
inside = [0.0, 1.0, 0.0, 0.5]
[[groups]]
name = "browInnerUp"
part = "sheet"
ids = [3, 4, 5]
move = [[0.0, 1.0, 0.0], [0.0, 2.0, 0.5], [0.0, 1.0, 0.0]]
"""
DRAGGED = {"format": 1, "name": "jawOpen", "part": "sheet", "ids": [5, 9], "moves_mm": [[0, 0, 1.5], [0.2, 0, 1]]}


def triangles_of(faces: Ints) -> Ints:
    """Quads (f, 4) as triangles (2 f, 3)."""
    return np.vstack([faces[:, :3], faces[:, [0, 2, 3]]])


def plys(vertices: Floats, faces: Ints) -> list[bytes]:
    """The mesh as text with colours and quads, binary in both orders with triangles, and in strips."""
    head = f"ply\nformat {{}} 1.0\ncomment TextureFile skin.png\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    colour = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    rows = [f"{x:.3f} {y:.3f} {z:.3f} 200 {k % 256} 90" for k, (x, y, z) in enumerate(vertices)]
    rows += ["4 " + " ".join(map(str, face)) for face in faces]
    element = "element face {}\nproperty list uchar int vertex_indices\n"
    text = head.format("ascii") + colour + element.format(len(faces)) + "end_header\n" + "\n".join(rows) + "\n"
    tri = triangles_of(faces)
    out = [text.encode()]
    for mark, order in (("<", "little"), (">", "big")):
        start = head.format(f"binary_{order}_endian") + element.format(len(tri)) + "end_header\n"
        body = b"".join(struct.pack(f"{mark}3f", *v) for v in vertices)
        out.append(start.encode() + body + b"".join(struct.pack(f"{mark}B3i", 3, *t) for t in tri))
    strip = [*faces[0, [0, 3, 1, 2]], -1, *faces[1, [0, 3, 1, 2]]]
    start = head.format("ascii") + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    rows = [f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in vertices] + [" ".join(map(str, [len(strip), *strip]))]
    return [*out, (start + "\n".join(rows) + "\n").encode()]


def stls(vertices: Floats, faces: Ints) -> list[bytes]:
    """The mesh as binary and as text STL."""
    corners = vertices[triangles_of(faces)]
    binary = bytes(80) + struct.pack("<I", len(corners))
    binary += b"".join(struct.pack("<12fH", 0, 0, 1, *t.ravel(), 0) for t in corners)
    facet = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"
    lines = (facet.format("".join(f"vertex {x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in t)) for t in corners)
    return [binary, f"solid face\n{''.join(lines)}endsolid face\n".encode()]


def off(vertices: Floats, faces: Ints) -> bytes:
    """The mesh as OFF."""
    rows = [f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in vertices] + ["4 " + " ".join(map(str, f)) for f in faces]
    return "\n".join(["OFF", f"{len(vertices)} {len(faces)} 0", *rows, ""]).encode()


def landmark_files() -> dict[str, list[bytes]]:
    """Landmarks by the file they are in."""
    table = {"landmarks": {"nose_tip": [20.0, 10.5, 35.0], "chin": {"vertex": 2}, "upper_lip": 9}}
    bare = b"nose_tip = [20.0, 10.5, 35.0]\nchin = 3\n"
    return {"marks.toml": [MARKS, bare], "marks.json": [json.dumps(table).encode()], "marks.pp": [PICKED]}


def read_marks(scan: Scan, path: Path) -> object:
    """What ``--landmarks`` reads."""
    return read_landmarks(path, scan)


def read_groups(surface: DCPSurface, path: Path) -> object:
    """What ``--groups`` reads: the head of a surface with these groups."""
    options = SurfaceOptions(unit="mm", up="y", forward="z", groups=(path,))
    return head_of([NamedSurface("sheet", surface)], name="h", options=options)


__all__ = [
    "DRAGGED", "GROUPS", "landmark_files", "off", "plys", "read_groups", "read_marks", "read_scan", "stls",
]  # fmt: skip
