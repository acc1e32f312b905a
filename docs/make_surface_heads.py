"""Draw the heads made of surface files in docs/surface.md: at rest, moved by a group file, with expressions of ICT.

Run from the repository's root: ``python docs/make_surface_heads.py [KIND ...]``; kinds are thb, tensor, tspline and
3dm. Takes some minutes a kind. The surfaces are made of the shipped head, seen from an axis inside it: a G+Smo
THB-spline and a tensor-product mask, a T-spline whose control mesh is a cube's and has star points, and a closed NURBS
head with eyeballs.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.interpolate import make_lsq_spline

from surface.check.raster import View
from surface.fit.surfaces import SurfaceOptions, fit_surfaces
from surface.head import Head
from surface.readers.thb import Hierarchy, Level, dyadic_refinement
from surface.view import Camera, Offscreen
from surface.view.draw.decimate import decimate_head
from surface.view.draw.grain import grain_head
from surface.view.pictures.occlusion import shade_head
from surface.view.scene.framing import framed

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "pictures"
ICT = ROOT / "configs" / "heads" / "ict"
SIZE = 300
AXIS = np.array([0.0, 10.0, 10.0])  # a point inside the head, mm
EYES = np.array([[31.8, 36.1, 84.2], [-31.8, 36.1, 84.2]])
EYE_RADIUS, SOCKET_MM = 12.0, 5.0
LOWEST_MM = -100.0  # of what is seen from a point: below, the neck widens to the shoulders
POSES: dict[str, dict[str, float]] = {
    "smile": {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0, "cheekSquintLeft": 0.6, "cheekSquintRight": 0.6},
    "surprise": {"browInnerUp": 1.0, "browOuterUpLeft": 1.0, "browOuterUpRight": 1.0, "jawOpen": 0.35},
}
GROUPS = """\
[[groups]]
name = "browInnerUp"
at = [0.0, 70.0, 112.0]
radius = 42.0
move = [0.0, 9.0, 2.0]

[[groups]]
name = "mouthSmileLeft"
mirror = "mouthSmileRight"
at = [25.0, -32.0, 100.0]
radius = 26.0
move = [6.0, 9.0, -5.0]
"""
HAND: dict[str, float] = {"browInnerUp": 1.0, "mouthSmileLeft": 1.0, "mouthSmileRight": 1.0}


class Radius:
    """How far the outermost skin is from the middle of the head, by direction.

    around : "axis" for distances from a vertical line by angle and height, "point" for those from a point by longitude
    and latitude. pose : of the shipped head. materials : of the parts that count.
    """

    def __init__(self, around: str, pose: dict[str, float], materials: tuple[str, ...]) -> None:
        head = Head.load(ICT)
        head.pose(head.values(pose))
        self._around, shapes = around, []
        for part in (p for p in head.parts if p.material in materials):
            at = self.coordinates(part.vertices.astype(float))
            triangles = _whole(at, part.triangles)
            if around == "point":
                triangles = triangles[part.vertices[triangles, 1].min(axis=1) > LOWEST_MM]
            for turn in (-360.0, 0.0, 360.0):
                moved = at + np.array([turn, 0.0, 0.0])
                shapes.append((moved.astype(np.float32), triangles))
        self._view = View((-200.0, 200.0), (-160.0, 160.0), 0.5)
        self._depth = self._view.draw(shapes).depth
        seen = np.flatnonzero(np.isfinite(self._depth).any(axis=0))
        columns = np.arange(self._depth.shape[1])
        self._depth = self._depth[:, seen[np.abs(columns[:, None] - seen).argmin(axis=1)]]  # none where angles jump

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) angle in degrees, height in mm or latitude in degrees, and distance in mm of points."""
        x, y, z = (points - AXIS).T
        angle, flat = np.degrees(np.arctan2(x, z)), np.hypot(x, z)
        if self._around == "axis":
            return np.column_stack([angle, y, flat])
        return np.column_stack([angle, np.degrees(np.arctan2(y, flat)), np.hypot(flat, y)])

    def points(self, angle: np.ndarray, height: np.ndarray) -> np.ndarray:
        """(..., 3) places of the skin by angle and height or latitude; beyond its ends the last one is kept."""
        distance = self._distance(angle, height)
        a = np.radians(angle)
        if self._around == "axis":
            local = np.stack([distance * np.sin(a), height, distance * np.cos(a)], axis=-1)
        else:
            b = np.radians(height)
            across = distance * np.cos(b)
            local = np.stack([across * np.sin(a), distance * np.sin(b), across * np.cos(a)], axis=-1)
        return local + AXIS

    def _distance(self, angle: np.ndarray, height: np.ndarray) -> np.ndarray:
        depth, step = self._depth, self._view.step
        column = np.clip(((angle - self._view.x[0]) / step).round().astype(int), 0, depth.shape[1] - 1)
        row = np.clip(((height - self._view.y[0]) / step).round().astype(int), 0, depth.shape[0] - 1)
        out = np.empty(np.shape(angle))
        for index in np.ndindex(*np.shape(angle)):
            own = depth[:, column[index]]
            known = np.flatnonzero(np.isfinite(own))
            out[index] = own[known[np.argmin(np.abs(known - row[index]))]]
        return out


def _whole(at: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles that do not go round the back, where the angle jumps."""
    return triangles[np.ptp(at[triangles, 0], axis=1) < 180.0].astype(np.int32)


def tensor_net(samples: np.ndarray, knots: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(nu, nv, 3) control points of the cubic tensor-product spline nearest to a lattice of samples over the knots."""
    net = samples
    for axis, t in enumerate(knots):
        at = np.linspace(t[0], t[-1], net.shape[axis])
        net = np.moveaxis(make_lsq_spline(at, np.moveaxis(net, axis, 0), t, 3).c, 0, axis)
    return net


def open_knots(spans: int) -> np.ndarray:
    """Clamped cubic knots over 0 to 1."""
    return np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, spans + 1), [1.0] * 3])


def mask(angle: float, low: float, high: float, pose: dict[str, float]) -> np.ndarray:
    """(241, 241, 3) samples of the face, u across and v up."""
    skin = Radius("axis", pose, ("skin", "eye"))
    a, h = np.meshgrid(np.linspace(-angle, angle, 241), np.linspace(low, high, 241), indexing="ij")
    return skin.points(a, h)


def write_tensor(path: Path) -> None:
    """A tensor-product mask in G+Smo's XML, eyes closed."""
    knots = open_knots(40), open_knots(44)
    net = tensor_net(mask(78.0, -105.0, 120.0, {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}), knots)
    basis = f'<Basis type="TensorBSplineBasis2">\n{_sides(knots)}</Basis>\n'
    path.write_text(_geometry("TensorBSpline2", basis, net.transpose(1, 0, 2).reshape(-1, 3)))


def write_thb(path: Path) -> None:
    """A THB mask of three levels, the finest about eyes, nose and mouth: coefficients of each level's own net (Speleers
    and Manni 2016)."""
    levels = [Level((3, 3), (open_knots(12), open_knots(12)))]
    for _ in range(2):
        levels.append(dyadic_refinement(levels[-1]))
    boxes = [(1, 4, 2, 20, 22), (2, 12, 10, 36, 38)]
    depth = np.zeros((48, 48), np.int64)
    for level, *corners in boxes:
        u0, v0, u1, v1 = (c * 2 ** (2 - level) for c in corners)
        depth[u0:u1, v0:v1] = np.maximum(depth[u0:u1, v0:v1], level)
    samples = mask(78.0, -105.0, 120.0, {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0})
    nets = [tensor_net(samples, level.knots) for level in levels]
    active = Hierarchy(levels, depth).active
    rows = np.array([nets[level][i, j] for level, i, j in active])
    marks = "".join(f'<box level="{b[0]}">{b[1]} {b[2]} {b[3]} {b[4]}</box>\n' for b in boxes)
    inner = f'<Basis type="TensorBSplineBasis2">\n{_sides(levels[0].knots)}</Basis>\n'
    path.write_text(_geometry("THBSpline2", f'<Basis type="THBSplineBasis2">\n{inner}{marks}</Basis>\n', rows))


def _sides(knots: tuple[np.ndarray, np.ndarray]) -> str:
    return "".join(
        f'<Basis type="BSplineBasis" index="{k}">\n<KnotVector degree="3">{" ".join(map(repr, t.tolist()))}'
        "</KnotVector></Basis>\n"
        for k, t in enumerate(knots)
    )


def _geometry(kind: str, basis: str, rows: np.ndarray) -> str:
    coefs = "\n".join(" ".join(repr(float(x)) for x in row) for row in rows)
    body = f'<coefs geoDim="3">{coefs}\n</coefs>'
    return f'<?xml version="1.0"?>\n<xml>\n<Geometry type="{kind}" id="0">\n{basis}{body}\n</Geometry>\n</xml>\n'


def write_tspline(path: Path, cells: int = 26) -> None:
    """A closed T-spline whose control mesh is a cube's with ``cells`` faces along each edge: eight star points."""
    skin = Radius("point", {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}, ("skin", "eye"))
    places: dict[tuple[int, int, int], int] = {}
    quads = []
    for axis in range(3):
        for side in (0, cells):
            for i in range(cells):
                for j in range(cells):
                    ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)][:: 1 if side else -1]
                    corners = [tuple(np.insert(c, axis, side)) for c in ring]
                    if axis == 1:
                        corners = corners[::-1]
                    quads.append([places.setdefault(c, len(places)) for c in corners])
    at = np.tan((np.array(list(places)) / cells - 0.5) * np.pi / 2.0)
    direction = at / np.linalg.norm(at, axis=1)[:, None]
    angle = np.degrees(np.arctan2(direction[:, 0], direction[:, 2]))
    path.write_text(tsm_text(quads, skin.points(angle, np.degrees(np.arcsin(direction[:, 1])))))


def tsm_text(quads: list[list[int]], points: np.ndarray) -> str:
    """A closed mesh of quads as a T-spline with knot intervals of 1; each vertex is a grip."""
    links = {
        (a, b): (face, k) for face, q in enumerate(quads) for k, (a, b) in enumerate(zip(q, q[1:] + q[:1], strict=True))
    }
    number = {link: 4 * face + k for link, (face, k) in links.items()}
    edges = {edge: k for k, edge in enumerate(sorted({(min(e), max(e)) for e in links}))}
    first: dict[int, int] = {}
    rows = [""] * len(links)
    for (a, b), (face, k) in links.items():
        own = number[a, b]
        first.setdefault(a, own)
        around = f"{4 * face + (k + 3) % 4} {4 * face + (k + 1) % 4} {number[b, a]}"
        rows[own] = f"l {around} {a} {face} {edges[min(a, b), max(a, b)]} 0"
    lines = ["#TS0200", "", "degree 3", "cap-type G1CAPS", "star-smoothness 0", "units 1 centimeters"]
    lines += [f"f {4 * face} 0" for face in range(len(quads))]
    lines += [f"e {number[edge]} 1" for edge in edges]
    lines += [f"v {first[v]} NORTH" for v in range(len(points))]
    lines += rows + [f"0g {x!r} {y!r} {z!r} 1" for x, y, z in points.tolist()]
    return "\n".join([*lines, "", "tol 1e-05", ""])


def write_3dm(path: Path) -> None:
    """A NURBS head that is closed around and ends in a pole at its top, with round sockets and two spheres in them."""
    import rhino3dm

    skin = Radius("point", {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}, ("skin",))
    around, up = 144, 84
    angles = -180.0 + 360.0 * np.arange(around) / around
    a, h = np.meshgrid(angles, np.linspace(-50.0, 89.9, 421), indexing="ij")
    rows = sunken(skin.points(a, h))
    knots = open_knots(up - 3)
    across = make_lsq_spline(np.linspace(0.0, 1.0, 421), np.moveaxis(rows, 1, 0), knots, 3).c.transpose(1, 0, 2)
    across[:, -1] = across[:, -1].mean(axis=0)
    surface = rhino3dm.NurbsSurface.Create(3, False, 4, 4, around + 3, up)
    for k in range(around + 5):
        surface.KnotsU[k] = float(k - 2)
    for k, knot in enumerate(knots[1:-1]):
        surface.KnotsV[k] = float(knot)
    for i in range(around + 3):
        for j in range(up):
            surface.Points[i, j] = rhino3dm.Point4d(*across[i % around, j].tolist(), 1.0)
    model = rhino3dm.File3dm()
    model.Objects.AddSurface(surface)
    for eye in EYES:
        model.Objects.AddBrep(rhino3dm.Sphere(rhino3dm.Point3d(*eye.tolist()), EYE_RADIUS).ToBrep())
    model.Write(str(path), 7)


def sunken(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) of the skin, pressed in around the eyes so that their fronts show."""
    out = points.copy()
    for eye in EYES:
        off = np.hypot(points[..., 0] - eye[0], (points[..., 1] - eye[1]) / 0.72)
        deep = np.where(points[..., 2] > eye[2] - 5.0, SOCKET_MM * np.exp(-((off / 11.0) ** 4)), 0.0)
        out[..., 2] -= deep
    return out


KINDS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "thb": ("face.xml", write_thb), "tensor": ("mask.xml", write_tensor), "tspline": ("head.tsm", write_tspline),
    "3dm": ("head.3dm", write_3dm),
}  # fmt: skip


def draw(kind: str, folder: Path) -> None:
    """Make one kind's heads and its picture: at rest and by hand-made groups; two expressions of ICT."""
    file, write = KINDS[kind]
    path, groups = folder / file, folder / "groups.toml"
    write(path)
    groups.write_text(GROUPS)
    say = lambda step, done: print(f"{kind}: {step} {100 * done:.0f} %", flush=True)  # noqa: E731, T201
    by_hand = fit_surfaces(path, folder / "hand", name=kind, options=SurfaceOptions(unit="mm", groups=(groups,)))
    print("\n".join(by_hand.lines()))  # noqa: T201
    carried = SurfaceOptions(unit="mm", expressions_from=ICT)
    print("\n".join(fit_surfaces(path, folder / "ict", name=kind, options=carried, progress=say).lines()))  # noqa: T201
    wanted = [("hand", {}), ("hand", HAND), ("ict", POSES["smile"]), ("ict", POSES["surprise"])]
    camera = framed(Camera.front().orbit(18.0, 0.0), Head.load(folder / "ict"))  # a little from its left
    images = [picture(folder / name, pose, camera) for name, pose in wanted]
    sheet = Image.new("RGB", (SIZE * len(images), SIZE))
    for k, image in enumerate(images):
        sheet.paste(image, (SIZE * k, 0))
    sheet.save(FOLDER / f"surface-head-{kind}.webp", quality=80, method=6)


def picture(folder: Path, pose: dict[str, float], camera: Camera) -> Image.Image:
    """A head in a pose."""
    if not (folder / "decimated.npz").exists():
        decimate_head(folder)
        grain_head(folder)
        shade_head(folder)
    head = Head.load(folder)
    with Offscreen(head, (SIZE, SIZE)) as screen:
        return Image.fromarray(screen.render(head.values(pose), camera))


if __name__ == "__main__":
    for chosen in sys.argv[1:] or KINDS:
        with tempfile.TemporaryDirectory() as made:
            draw(chosen, Path(made))
