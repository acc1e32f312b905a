"""Draw a head of omote from its files with nothing but numpy: docs/head-format.md in a hundred lines.

    python examples/draw_head.py configs/heads/ict smile.png mouthSmileLeft=1 mouthSmileRight=1 jawOpen=0.3

It evaluates Eq. (1) at the stored vertices, after groups, rules and the jaw have moved the control points. What needs
more than the two files say is left out: contacts of lips and lids, gaze, the head's rotation, seams and paint; and so
are accessories, such as hair that the head wears as a mesh, and textures, which lie in files of their own.
"""

from __future__ import annotations

import struct
import sys
import tomllib
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

COLOURS = {"skin": (214, 168, 144), "brow": (70, 48, 38), "lash": (40, 30, 28), "teeth": (232, 226, 214),
           "gums": (176, 92, 88), "tongue": (188, 98, 98), "mouth": (120, 48, 46), "eye": (222, 222, 218)}  # fmt: skip


def blending(knots: np.ndarray, degree: int, x: np.ndarray, left: np.ndarray) -> np.ndarray:
    """(k, m) blending functions over knots (k, degree + 2) at x (m,), by Cox and de Boor; left (m,) bool asks for the
    limit from the left."""
    t, x = knots[:, :, None], x[None, None]
    level = np.where(left, (t[:, :-1] < x) & (x <= t[:, 1:]), (t[:, :-1] <= x) & (x < t[:, 1:])).astype(float)
    for p in range(1, degree + 1):
        up, down = t[:, p:-1] - t[:, : -p - 1], t[:, p + 1 :] - t[:, 1:-p]
        rise = np.where(up > 0, (x - t[:, : -p - 1]) / np.where(up > 0, up, 1), 0)
        fall = np.where(down > 0, (t[:, p + 1 :] - x) / np.where(down > 0, down, 1), 0)
        level = rise * level[:, :-1] + fall * level[:, 1:]
    return level[:, 0]


def evaluate(part: dict[str, np.ndarray], points: np.ndarray) -> np.ndarray:
    """(m, 3) vertices of a part, Eq. (1), from its control points (n, 3): cell by cell from the points listed there."""
    out, start, first = np.zeros((len(part["mesh_uv"]), 3)), part["mesh_cell_start"], part["mesh_list_start"]
    for c in range(len(start) - 1):
        rows, ids = slice(start[c], start[c + 1]), part["mesh_list_ids"][first[c] : first[c + 1]]
        weights = np.tile(part["weights"][ids, None], (1, start[c + 1] - start[c]))
        for axis, key in enumerate(("knots_u", "knots_v")):
            x, left = part["mesh_uv"][rows, axis], part["mesh_side"][rows] >> axis & 1 == 1
            for degree in np.unique(part["degrees"][ids, axis]):
                own = part["degrees"][ids, axis] == degree
                weights[own] *= blending(part[key][ids[own], : degree + 2], int(degree), x, left)
        out[rows] = weights.T @ points[ids] / weights.sum(axis=0)[:, None]
    return out


def amounts_of(head: dict, shapes: dict[str, float]) -> dict[str, float]:
    """Amounts of all groups: of the shapes as given, and of the rules, which are products of sums of them."""
    amounts = dict(shapes)
    for rule in head.get("rules", []):
        terms = [sum(share * shapes.get(name, 0.0) for name, share in term.items()) for term in rule["terms"]]
        amounts[rule["group"]] = float(np.prod(np.clip(terms, 0, 1))) ** rule["power"]
    return amounts


def jaw_motion(head: dict, shapes: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and shift (3,) of the jaw, opened by jawOpen: about the x axis, and a glide."""
    jaw, amount = head["jaw"], shapes.get("jawOpen", 0.0)
    c, s = np.cos(jaw["angle_rad"] * amount), np.sin(jaw["angle_rad"] * amount)
    turn, centre = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array(jaw["centre"])
    return turn, centre - turn @ centre + amount * np.array(jaw["glide"])


def posed(head: dict, table: dict, part: dict[str, np.ndarray], shapes: dict[str, float]) -> np.ndarray:
    """(n, 3) control points of a part: displacements of its groups, and the jaw's motion by the share of each point."""
    points, amounts, begin = part["points"].copy(), amounts_of(head, shapes), 0
    for name, end in zip(table["groups"], part["group_ends"], strict=True):
        moves = amounts.get(name, 0.0) * part["group_moves"][begin:end].astype(float)
        np.add.at(points, part["group_ids"][begin:end], moves)
        begin = end
    turn, shift = jaw_motion(head, shapes)
    if table["follows"] == "jaw":
        for name, tilt in head["jaw"]["tilts"].items():
            turn = turn + shapes.get(name, 0.0) * np.array(tilt)[:, :3]
            shift = shift + shapes.get(name, 0.0) * np.array(tilt)[:, 3]
        return points @ turn.T + shift
    return points + part["jaw"][:, None] * (part["points"] @ turn.T + shift - part["points"])


def parts_of(folder: Path, shapes: dict[str, float]) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Material, vertices (m, 3) in mm and triangles (t, 3) of every part of a head."""
    head = tomllib.loads((folder / "head.toml").read_text(encoding="utf-8"))
    if head["format"] != 1:
        raise SystemExit(f"{folder}: format {head['format']}; this program reads 1")
    with np.load(folder / "head.npz") as stored:
        for table in head["parts"]:
            part = {key.split("/", 1)[1]: stored[key] for key in stored if key.startswith(table["name"] + "/")}
            yield table["material"], evaluate(part, posed(head, table, part, shapes)), part["mesh_triangles"]


def draw(parts: Iterator[tuple[str, np.ndarray, np.ndarray]], size: int = 720, scale: float = 2.0) -> np.ndarray:
    """(size, size, 3) uint8: a parallel view from the front; samples fill every triangle, the nearest is seen."""
    picture, nearest = np.full((size * size, 3), 244.0), np.full(size * size, -np.inf)
    for material, vertices, triangles in parts:
        corners = vertices[triangles]
        normals = np.zeros_like(vertices)
        for k in range(3):
            np.add.at(normals, triangles[:, k], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        light = normals @ [0.25, 0.45, 0.86] / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
        flat = np.tile(COLOURS.get(material, (150, 150, 150)), (len(vertices), 1))
        if material == "eye":  # an iris and a pupil, as the eyeball looks ahead
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            ahead = (vertices - (low + high) / 2)[:, 2] / (high - low)[0] * 2
            flat[ahead > 0.87], flat[ahead > 0.96] = (92, 68, 48), (16, 14, 14)
        colour = flat * (0.45 + 0.6 * np.clip(light, 0, 1))[:, None]
        pixels = np.array([0.5, 0.42]) * size + scale * vertices[:, :2] * [1, -1]
        edges = pixels[triangles] - np.roll(pixels[triangles], 1, axis=1)
        steps = np.clip(np.ceil(1.5 * np.linalg.norm(edges, axis=2).max(axis=1)), 1, 200).astype(int)
        for n in np.unique(steps):
            i, j = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T
            share, own = np.stack([i, j, n - i - j], axis=1) / n, triangles[steps == n]
            x, y = (np.floor(share @ pixels[own][:, :, k].T).astype(int).ravel() for k in range(2))
            depth = (share @ vertices[own][:, :, 2].T).ravel()
            paint = (share @ colour[own].transpose(2, 1, 0)).reshape(3, -1)
            seen = (x >= 0) & (x < size) & (y >= 0) & (y < size)
            place, order = (y * size + x)[seen], np.argsort(depth[seen], kind="stable")
            place, depth, paint = place[order], depth[seen][order], paint[:, seen][:, order].T
            front = depth > nearest[place]
            picture[place[front]], nearest[place[front]] = paint[front], depth[front]
    return picture.clip(0, 255).astype(np.uint8).reshape(size, size, 3)


def write_png(path: Path, picture: np.ndarray) -> None:
    """Write an RGB picture (h, w, 3) uint8."""
    height, width, _ = picture.shape
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    parts = [struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def main(arguments: list[str]) -> None:
    """Draw the head of a folder into a PNG file, with shapes as NAME=VALUE."""
    if len(arguments) < 2:
        raise SystemExit("usage: python examples/draw_head.py HEAD_FOLDER PICTURE.png [SHAPE=VALUE ...]")
    shapes = {name: float(value) for name, value in (word.split("=") for word in arguments[2:])}
    write_png(Path(arguments[1]), draw(parts_of(Path(arguments[0]), shapes)))


if __name__ == "__main__":
    main(sys.argv[1:])
