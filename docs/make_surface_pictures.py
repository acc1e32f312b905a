"""Draw the pictures of docs/surface.md with the engine itself and Pillow.

Run from the repository's root: ``python docs/make_surface_pictures.py``. Takes under a minute.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from surface import DCPSurface, Domain, Mesh, Slit
from surface.spline.basis import blending

FOLDER = Path(__file__).parent / "pictures"
FINE = 3  # pixels drawn per pixel kept
INK, GREY, PALE, ORANGE, BLUE, RED = "#223", "#9aa2ad", "#e3e7ec", "#e07b1a", "#3b6ea8", "#c62828"
CUT = 3 / 13, 10 / 13  # where the slit begins and ends: at knots of the sheet
LIGHT = np.array([0.35, -0.45, 0.82])


class Sheet:
    """A white picture with a few panels; coordinates are pixels of the finished picture."""

    def __init__(self, width: int, height: int) -> None:
        self.size = width, height
        self.image = Image.new("RGB", (width * FINE, height * FINE), "white")
        self.draw = ImageDraw.Draw(self.image)

    def line(self, points: np.ndarray, colour: str, width: float = 1.0) -> None:
        """An open polyline (k, 2)."""
        self.draw.line([tuple(p) for p in np.asarray(points) * FINE], colour, max(1, round(width * FINE)), "curve")

    def area(
        self, points: np.ndarray, colour: tuple[int, ...] | str, edge: tuple[int, ...] | str | None = None
    ) -> None:
        """A filled polygon (k, 2)."""
        self.draw.polygon([tuple(p) for p in np.asarray(points) * FINE], colour, edge)

    def dot(self, at: np.ndarray, colour: str, radius: float = 3.0, rim: float = 1.0) -> None:
        """A disc with a white rim."""
        for r, fill in ((radius + rim, "white"), (radius, colour)):
            x, y = np.asarray(at) * FINE
            self.draw.ellipse((x - r * FINE, y - r * FINE, x + r * FINE, y + r * FINE), fill)

    def text(
        self, at: tuple[float, float], words: str, colour: str = INK, size: float = 15, anchor: str = "la"
    ) -> None:
        """A line of text."""
        font = ImageFont.load_default(size * FINE)
        self.draw.text((at[0] * FINE, at[1] * FINE), words, colour, font, anchor)

    def save(self, name: str) -> None:
        """Write a small PNG."""
        image = self.image.resize(self.size, Image.Resampling.LANCZOS)
        FOLDER.mkdir(exist_ok=True)
        image = image.quantize(256, Image.Quantize.MEDIANCUT, kmeans=4, dither=Image.Dither.NONE)
        image.save(FOLDER / name, optimize=True)


class Flat:
    """The (u, v) square as a panel, v upwards."""

    def __init__(self, sheet: Sheet, left: float, top: float, side: float) -> None:
        self.sheet, self.corner, self.side = sheet, np.array([left, top + side]), side
        sheet.line(self.at([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]), INK, 1.2)
        sheet.text((left + side, top + side + 5), "u", GREY, anchor="ra")
        sheet.text((left - 5, top), "v", GREY, anchor="ra")

    def at(self, uv: np.ndarray | list) -> np.ndarray:
        """Pixels of (u, v)."""
        return self.corner + np.asarray(uv, dtype=float) * [self.side, -self.side]

    def box(self, support: np.ndarray, colour: str, width: float = 1.0) -> None:
        """The outline of a subdomain (u0, u1, v0, v1)."""
        u0, u1, v0, v1 = np.clip(support, 0, 1)
        self.sheet.line(self.at([[u0, v0], [u1, v0], [u1, v1], [u0, v1], [u0, v0]]), colour, width)


class View:
    """A slanted look at surfaces over a 100 x 100 ground."""

    def __init__(self, sheet: Sheet, left: float, top: float, scale: float, tilt: float = 0.9) -> None:
        self.sheet, self.origin, self.scale = sheet, np.array([left, top]), scale
        turn, s, c = np.radians(28), np.sin(tilt), np.cos(tilt)
        x, y = np.array([np.cos(turn), np.sin(turn), 0]), np.array([-np.sin(turn), np.cos(turn), 0])
        self.right, self.up, self.near = x, y * c + np.array([0, 0, s]), -y * s + np.array([0, 0, c])

    def at(self, xyz: np.ndarray) -> np.ndarray:
        """Pixels of points (k, 3)."""
        p = np.atleast_2d(xyz) - [50, 50, 0]
        return self.origin + self.scale * np.stack([p @ self.right, -(p @ self.up)], axis=1)

    def mesh(self, mesh: Mesh, xyz: np.ndarray, normals: np.ndarray, tint: np.ndarray | None = None) -> None:
        """A shaded mesh; ``tint (m,)`` from 0 to 1 blends to orange."""
        corners = mesh.triangles[np.argsort((xyz @ self.near)[mesh.triangles].mean(axis=1))]
        shade = 0.45 + 0.55 * np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
        colour = np.array([176, 200, 222]) * shade[:, None]
        if tint is not None:
            colour += tint[:, None] * (np.array([235, 130, 30]) * shade[:, None] - colour)
        pixels, fill = self.at(xyz), colour[corners].mean(axis=1).astype(int)
        for triangle, paint in zip(corners, fill, strict=True):
            self.sheet.area(pixels[triangle], tuple(map(int, paint)), tuple(map(int, paint * 0.93)))


def hills(n: int = 12, height: float = 9.0) -> DCPSurface:
    """A wavy cubic sheet 100 x 100 over the unit square."""
    knots = np.concatenate([[0] * 3, np.linspace(0, 1, n - 2), [1] * 3])
    place = np.array([knots[k + 1 : k + 4].mean() for k in range(n)]) * 100
    x, y = np.meshgrid(place, place, indexing="ij")
    z = height * np.sin(x / 100 * 6) * np.cos(y / 100 * 5)
    return DCPSurface.from_nurbs(3, 3, knots, knots, np.stack([x, y, z], axis=-1))


def nearest(surface: DCPSurface, u: float, v: float) -> int:
    """The point whose subdomain's centre is nearest, among the smallest ones there."""
    s = surface.supports
    centre = np.stack([s[:, 0] + s[:, 1], s[:, 2] + s[:, 3]], axis=1) / 2
    return int(np.argmin(np.linalg.norm(centre - [u, v], axis=1) + 0.2 * (s[:, 1] - s[:, 0])))


def share(surface: DCPSurface, i: int, uv: np.ndarray) -> np.ndarray:
    """(m,) how much of the surface at ``uv`` is point i's: its weight in Eq. (1)."""
    return surface.basis_matrix(uv)[:, [i]].toarray()[:, 0]


def draw_point() -> None:
    """One control point among others: subdomain, knots, blending function, and its part of the surface."""
    surface = hills(10).refine((0.5, 0.8, 0.45, 0.8)).surface
    i = nearest(surface, 0.62, 0.58)
    sheet = Sheet(1000, 440)
    flat = Flat(sheet, 60, 50, 340)
    heat(flat, surface, i)
    for support in surface.supports:
        centre = [(support[0] + support[1]) / 2, (support[2] + support[3]) / 2]
        sheet.dot(flat.at(centre), GREY, 2)
    flat.box(surface.supports[i], ORANGE, 2.5)
    for k, (knots, axis) in enumerate(((surface.knots_u[i], 0), (surface.knots_v[i], 1))):
        along = np.linspace(knots[0], knots[-1], 80)
        bump = 0.09 * blending(knots, along)
        side = np.full(80, 0.0)
        curve = np.stack([along, side + bump], 1) if axis == 0 else np.stack([side + bump, along], 1)
        sheet.line(flat.at(curve), BLUE, 2)
        for t in knots:
            ends = [[t, 0], [t, 0.02]] if k == 0 else [[0, t], [0.02, t]]
            sheet.line(flat.at(ends), BLUE, 2)
    flat.box(surface.supports[nearest(surface, 0.25, 0.75)], GREY, 1.5)
    sheet.text((60, 20), "one point's subdomain, knots and blending functions")
    view = View(sheet, 725, 235, 3.7)
    mesh = surface.tessellate(chord_error=0.03, min_depth=3)
    part = share(surface, i, mesh.uv)
    view.mesh(mesh, mesh.vertices, mesh.normals, part / part.max())
    for at in view.at(surface.points):
        sheet.dot(at, GREY, 2)
    sheet.dot(view.at(surface.points[i])[0], ORANGE, 5)
    sheet.text((520, 20), "what that point has a share in")
    sheet.save("surface-point.png")


def heat(flat: Flat, surface: DCPSurface, i: int) -> None:
    """Small squares coloured by the share of a point."""
    n = 120
    middles = (np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) + 0.5) / n
    value = share(surface, i, middles)
    value /= value.max()
    for uv, x in zip(middles[value > 0], value[value > 0], strict=True):
        colour = tuple(int(255 + x * (c - 255)) for c in (240, 150, 60))
        h = 0.5 / n
        flat.sheet.area(flat.at(uv + np.array([[-h, -h], [h, -h], [h, h], [-h, h]])), colour)


def draw_move() -> None:
    """Eq. (2): which cells a move touches, and the mesh after it."""
    surface = hills(14).refine((0.55, 0.8, 0.55, 0.8)).surface
    mesh = surface.tessellate(chord_error=0.06, min_depth=2)
    i = nearest(surface, 0.4, 0.35)
    touched = np.array([i in mesh.points_of(c) for c in range(len(mesh.cell_start) - 1)])
    d = surface.deformation(mesh)
    before = d.vertices.copy()
    d.move([i], [0.0, 0.0, 18.0])
    lift = d.vertices[:, 2] - before[:, 2]
    sheet = Sheet(1000, 440)
    flat = Flat(sheet, 60, 50, 340)
    for triangle in mesh.triangles:
        listed = touched[mesh.cell[triangle]].sum() > 1
        sheet.area(flat.at(mesh.uv[triangle]), "#fbe3cb" if listed else "white", "#c3c9d1")
    for uv in mesh.uv[lift != 0]:
        sheet.dot(flat.at(uv), ORANGE, 1.4, 0)
    flat.box(surface.supports[i], ORANGE, 2.5)
    flat.box(np.array([0, 1, 0, 1]), INK, 1.2)
    sheet.text((60, 20), f"cells that list the point: {touched.sum()} of {len(touched)};  dots: vertices that move")
    view = View(sheet, 730, 245, 3.7)
    view.mesh(mesh, d.vertices.astype(float), d.normals.astype(float), np.clip(lift / lift.max(), 0, 1))
    sheet.dot(view.at(d.points[i])[0], ORANGE, 5)
    sheet.line(view.at(np.stack([surface.points[i], d.points[i]])), ORANGE, 2)
    sheet.text((560, 20), "after move(i, (0, 0, 18))")
    sheet.save("surface-move.png")


def inside(supports: np.ndarray) -> np.ndarray:
    """(n,) bool: subdomains that keep to the slit's length."""
    return (supports[:, 0] > CUT[0] - 1e-9) & (supports[:, 1] < CUT[1] + 1e-9)


def slit_sheet() -> DCPSurface:
    """A sheet whose points end at v = 0.5 where the slit is."""
    surface = hills(16, 4.0)
    for _ in range(4):
        s = surface.supports
        ids = np.flatnonzero(inside(s) & (s[:, 2] < 0.5) & (s[:, 3] > 0.5))
        surface = surface.insert_knot("v", 0.5, ids).surface
    return surface


def draw_slit() -> None:
    """A slit: subdomains end there, so that one lip moves alone."""
    surface = slit_sheet()
    domain = Domain((0, 1, 0, 1), slits=[Slit("u", 0.5, *CUT)])
    mesh = surface.tessellate(chord_error=0.02, domain=domain, min_depth=2)
    s = surface.supports
    lower = np.flatnonzero((s[:, 3] == 0.5) & inside(s))
    d = surface.deformation(mesh)
    near = 1 - np.abs((s[lower, 0] + s[lower, 1]) / 2 - 0.5) / 0.3
    d.move(lower, np.stack([0 * near, -16 * near, -4 * near], axis=1))
    sheet = Sheet(1000, 440)
    flat = Flat(sheet, 60, 50, 340)
    upper = np.flatnonzero((s[:, 2] == 0.5) & inside(s))
    for ids, colour, pale in ((upper, BLUE, "#c9d8ea"), (lower, ORANGE, "#f6dcc0")):
        for i in ids:
            flat.box(s[i], pale, 1)
        wide = ids[np.argmax((s[ids, 1] - s[ids, 0]) * (s[ids, 3] - s[ids, 2]))]
        flat.box(s[wide], colour, 2.5)
    sheet.line(flat.at([[CUT[0], 0.5], [CUT[1], 0.5]]), RED, 4)
    sheet.text((60, 20), "subdomains end at the slit (red)")
    view = View(sheet, 735, 240, 2.9, 0.55)
    moved = np.linalg.norm(d.vertices - mesh.vertices, axis=1)
    view.mesh(mesh, d.vertices.astype(float), d.normals.astype(float), np.clip(moved / 14, 0, 1))
    sheet.text((560, 20), "the lower lip's points moved down")
    sheet.save("surface-slit.png")


def draw_refine() -> None:
    """The same move before and after a region is refined twice."""
    coarse = hills(9)
    fine = coarse.refine((0.35, 0.65, 0.35, 0.65)).surface.refine((0.4, 0.6, 0.4, 0.6)).surface
    sheet = Sheet(1000, 400)
    for k, (surface, words) in enumerate(
        ((coarse, "one of {} points moved"), (fine, "refined: one of {} points moved"))
    ):
        i = nearest(surface, 0.5, 0.5)
        moved = surface.points.copy()
        moved[i, 2] += 24
        shape = surface.with_points(moved)
        mesh = shape.tessellate(chord_error=0.03, min_depth=3)
        lift = mesh.vertices[:, 2] - surface.evaluate(mesh.uv)[:, 2]
        view = View(sheet, 260 + 490 * k, 225, 3.7)
        view.mesh(mesh, mesh.vertices, mesh.normals, np.clip(lift / lift.max(), 0, 1))
        for at in view.at(moved):
            sheet.dot(at, GREY, 1.8)
        sheet.dot(view.at(moved[i])[0], ORANGE, 5)
        sheet.text((60 + 490 * k, 20), words.format(surface.n))
    sheet.save("surface-refine.png")


def drift(moves: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of moves, and largest error after them: omote's, and that of 32-bit sums that are never renewed.

    Both errors are parts of the surface's size.
    """
    surface = hills(14).refine((0.4, 0.6, 0.4, 0.6)).surface
    mesh = surface.tessellate(max_points=30, min_depth=1)
    d, rng = surface.deformation(mesh), np.random.default_rng(1)
    weights = surface.basis_matrix(mesh.uv).toarray()
    naive, points = mesh.vertices.astype(np.float32), surface.points.copy()
    columns = weights.astype(np.float32).T.copy()
    stops = np.unique(np.geomspace(1, moves, 40).astype(int))
    ours, theirs = [], []
    for count in range(1, moves + 1):
        i, step = int(rng.integers(surface.n)), rng.normal(size=3)
        goal = surface.points[i] + step - points[i]
        points[i] += goal
        d.move([i], goal)
        naive += columns[i][:, None] * goal.astype(np.float32)
        if count in stops:
            true = weights @ points
            ours.append(np.abs(d.vertices - true).max() / 100)
            theirs.append(np.abs(naive - true).max() / 100)
    return stops, np.array(ours), np.array(theirs)


def draw_drift() -> None:
    """Errors against the number of moves, log-log."""
    stops, ours, theirs = drift(100_000)
    sheet = Sheet(760, 400)
    low, high = -8.0, -4.0

    def at(count: np.ndarray, error: np.ndarray) -> np.ndarray:
        x = 90 + 560 * np.log10(count) / 5
        y = 350 - 290 * (np.log10(np.maximum(error, 1e-9)) - low) / (high - low)
        return np.stack([x, y], axis=1)

    for power in range(6):
        x = at(np.array([10.0**power]), np.array([10**low]))[0, 0]
        sheet.line(np.array([[x, 60], [x, 350]]), PALE)
        sheet.text((x, 357), f"{10**power:,}", GREY, 13, "ma")
    for power in range(int(low), int(high) + 1):
        y = at(np.array([1.0]), np.array([10.0**power]))[0, 1]
        sheet.line(np.array([[90, y], [650, y]]), PALE)
        sheet.text((82, y), f"1e{power}", GREY, 13, "rm")
    for error, colour, words in ((theirs, GREY, "32-bit sums"), (ours, ORANGE, "omote")):
        line = at(stops, error)
        sheet.line(line, colour, 2.5)
        sheet.text((line[-1, 0] + 8, line[-1, 1]), words, colour, 14, "lm")
    sheet.text((90, 20), "largest error / size of the surface, after so many moves of single points")
    sheet.save("surface-drift.png")


def main() -> None:
    """Draw them all."""
    for draw in (draw_point, draw_move, draw_slit, draw_refine, draw_drift):
        draw()


if __name__ == "__main__":
    main()
