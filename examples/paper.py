"""The figures and numbers of the paper, made again and beside omote's own, on one HTML page.

    python examples/paper.py paper.html            # minutes: the meshes are compared as in docs/surface.md
    python examples/paper.py paper.html --short    # seconds: coarser meshes, shorter measurements

The paper is Hosaka, Sugimoto, Nishi and Kato, "Facial expression for a CG robot using real-time surface modification".
Its head is not published, so the shipped one (or ``--head FOLDER``) stands in for it.
"""

from __future__ import annotations

import argparse
import base64
import io
import time
from collections.abc import Callable
from html import escape
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from surface import Domain, Mesh
from surface.base.errors import ViewError
from surface.bench.comparison import Variant, compare, draw
from surface.deform.deformation import Deformation
from surface.head import Head
from surface.head.model.meshes import domain_of
from surface.view.pictures.offscreen import Offscreen

PAPER_SAVED, PAPER_FRAMES = 0.502, 14.3
EXPRESSIONS: dict[str, dict[str, float]] = {
    "at rest": {},
    "smile": {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.6, "cheekSquintRight": 0.6},
    "surprise": {"browInnerUp": 1.0, "browOuterUpLeft": 0.9, "browOuterUpRight": 0.9, "jawOpen": 0.5,
                 "eyeWideLeft": 0.8, "eyeWideRight": 0.8},
    "anger": {"browDownLeft": 1.0, "browDownRight": 1.0, "noseSneerLeft": 0.7, "noseSneerRight": 0.7,
              "mouthPressLeft": 0.6, "mouthPressRight": 0.6},
}  # fmt: skip
MEASURES: dict[str, float | None] = {"root mean square": None, "99 % of the area": 0.99, "greatest deviation": 1.0}
SIZE, FINE = 360, 4  # pixels of a drawing's side; how much finer cells are drawn first
SHADES = ("#dfe7ef", "#c9d8e6", "#b3c8dc", "#9db9d1")
MARKS = ("#f0a257", "#e88f38", "#e07b1a", "#c96a10")
STYLE = (
    "body{font:15px sans-serif;max-width:60em;margin:2em auto;padding:0 1em}td,th{padding:.2em .8em;text-align:left}"
    "img,svg{max-width:100%;height:auto}code{white-space:nowrap}"
)


def main() -> None:
    """Make the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path, help="the HTML file to write")
    parser.add_argument("--head", type=Path, default=Path("configs/heads/ict"), help="folder of a head")
    parser.add_argument("--short", action="store_true", help="coarser meshes, shorter measurements")
    given = parser.parse_args()
    given.page.write_text(page(Head.load(given.head), given.short), encoding="utf-8")


def page(head: Head, short: bool) -> str:
    """The HTML text."""
    data = max((part for part in head.data.parts if part.follows == "skin"), key=lambda part: len(part.points))
    surface, domain, mesh = head.part(data.name).surface, domain_of(data), head.part(data.name).mesh
    seconds, level = (0.05, 3) if short else (1.0, 7)
    moving = Deformation(surface, mesh)
    saved = {name: compare(surface, domain, level=level, quantile=q) for name, q in MEASURES.items()}
    frames, pictures = experiment(head, seconds)
    sections = [
        ("Beside the paper", summary(saved, frames)),
        ("2.2 Control points without a grid", subdomains(surface.supports, domain)),
        ("2.3 The quad tree (its figures 2 and 3)", quad_tree(saved["99 % of the area"])),
        ("2.4 Lists: cells that share one list of control points", cells(mesh, domain, set())),
        ("2.5 The differential update: cells that one moved point touches", update(moving, domain, seconds)),
        ("3 Experiment: expressions of a head", pictures),
    ]
    body = "".join(f"<h2>{escape(title)}</h2>{text}" for title, text in sections)
    about = f"{escape(head.name)}: {surface.n} control points and {len(mesh.vertices)} vertices on its {data.name}."
    note = (
        " Short form: meshes so coarse save nothing, and times are rough; leave out <code>--short</code> for figures."
        if short
        else ""
    )
    return (
        f'<!doctype html><meta charset="utf-8"><title>The paper</title><style>{STYLE}</style><p>{about}{note}</p>{body}'
    )


def table(rows: list[tuple[str, ...]]) -> str:
    """Rows of text, the first of them the head."""
    marked = ("".join(f"<{'td' if k else 'th'}>{escape(cell)}" for cell in row) for k, row in enumerate(rows))
    return "<table>" + "".join(f"<tr>{row}" for row in marked) + "</table>"


def summary(saved: dict[str, list[Variant]], frames: dict[str, float]) -> str:
    """The paper's two numbers beside ours, the least flattering first."""
    rows: list[tuple[str, ...]] = [("", "the paper", "omote")]
    for name, variants in saved.items():
        for way in ("by control points", "by chord error"):
            found = [in_words(v.saving) for v in variants if v.name == way]
            paper = f"{100 * PAPER_SAVED:.1f} %" if name == "greatest deviation" and "points" in way else ""
            rows.append((f"data saved {way}, at equal {name}", paper, found[0] if found else "none found"))
    rows += [
        (name, f"{PAPER_FRAMES} frames/s", f"{rate:.0f} frames/s")
        for name, rate in sorted(frames.items(), key=lambda x: x[1])
    ]
    return table(rows)


def in_words(saving: float) -> str:
    """A part that is saved, or, below 0, how much more is needed."""
    return f"{100 * saving:.1f} %" if saving >= 0.0 else f"none: {-100 * saving:.1f} % more"


def drawing(domain: Domain, shapes: list[str]) -> str:
    """Shapes in (u, v), v upwards, as SVG; coordinates are those of :func:`box`."""
    inside = "".join(shapes) + "".join(outline(domain, np.asarray(loop)) for loop in domain.loops)
    return f'<svg width="{SIZE}" height="{SIZE}" viewBox="0 0 {SIZE} {SIZE}">{inside}</svg>'


def scaled(domain: Domain, uv: np.ndarray) -> np.ndarray:
    """(m, 2) pixels of ``uv (m, 2)``."""
    u0, u1, v0, v1 = domain.rect
    return SIZE * np.stack([(uv[:, 0] - u0) / (u1 - u0), (v1 - uv[:, 1]) / (v1 - v0)], axis=1)


def outline(domain: Domain, loop: np.ndarray) -> str:
    """A loop as a line."""
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in scaled(domain, loop))
    return f'<polygon points="{points}" fill="none" stroke="#c62828"/>'


def box(domain: Domain, rect: np.ndarray) -> str:
    """The outline of a rectangle (u0, u1, v0, v1)."""
    (x0, y1), (x1, y0) = scaled(domain, np.array([rect[[0, 2]], rect[[1, 3]]]))
    size = f'width="{x1 - x0:.1f}" height="{y1 - y0:.1f}"'
    return f'<rect x="{x0:.1f}" y="{y0:.1f}" {size} fill="none" stroke="#e07b1a"/>'


def subdomains(supports: np.ndarray, domain: Domain) -> str:
    """Every control point at the middle of its subdomain, and the subdomains of some."""
    middles = scaled(domain, np.stack([supports[:, :2].mean(axis=1), supports[:, 2:].mean(axis=1)], axis=1))
    dots = [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="1.2" fill="#3b6ea8"/>' for x, y in middles]
    some = np.random.default_rng(2).choice(len(supports), min(12, len(supports)), replace=False)
    text = (
        "Every control point at the middle of its subdomain, and twelve of these subdomains. Red: outline and openings."
    )
    return f"<p>{text}</p>" + drawing(domain, dots + [box(domain, supports[i]) for i in some])


def cells(mesh: Mesh, domain: Domain, marked: set[int]) -> str:
    """The cells of a mesh, and some of them marked."""
    count = np.diff(mesh.list_start)
    text = f"{len(count)} cells; a list holds {int(np.median(count))} control points (median), {count.max()} at most."
    return f"<p>{text}</p>" + image(coloured(mesh, domain, marked), "png", SIZE)


def coloured(mesh: Mesh, domain: Domain, marked: set[int]) -> bytes:
    """A picture, PNG, of the triangles of a mesh in (u, v), each in the colour of its cell."""
    from PIL import Image, ImageDraw

    # vertices on a border belong to the first of the cells that share it
    cell = (np.searchsorted(mesh.cell_start, mesh.triangles, side="right") - 1).max(axis=1)
    places = FINE * scaled(domain, np.asarray(mesh.uv))
    picture = Image.new("RGB", (FINE * SIZE, FINE * SIZE), "white")
    pen = ImageDraw.Draw(picture)
    for triangle, c in zip(mesh.triangles, cell, strict=True):
        pen.polygon([tuple(places[k]) for k in triangle], fill=(MARKS if int(c) in marked else SHADES)[c % 4])
    for loop in domain.loops:
        pen.polygon([tuple(x) for x in FINE * scaled(domain, np.asarray(loop))], outline="#c62828", width=FINE)
    out = io.BytesIO()
    picture.resize((2 * SIZE, 2 * SIZE), Image.Resampling.LANCZOS).save(out, "png", optimize=True)
    return out.getvalue()


def rate(call: Callable[[], object], seconds: float) -> float:
    """Calls a second, of calls repeated for so long, at least three times."""
    call()
    begin, count = time.perf_counter(), 0
    while count < 3 or time.perf_counter() - begin < seconds:
        call()
        count += 1
    return count / (time.perf_counter() - begin)


def update(moving: Deformation, domain: Domain, seconds: float) -> str:
    """What one point costs beside all, and the cells it touches."""
    u0, u1, v0, v1 = domain.rect
    supports = moving.surface.supports
    off = np.hypot(supports[:, :2].mean(axis=1) - (u0 + u1) / 2, supports[:, 2:].mean(axis=1) - (v0 + v1) / 2)
    one = np.array([int(np.argmin(off))])
    steps = cycle(np.array([[[0.0, 0.0, 0.1]], [[0.0, 0.0, -0.1]]]))
    single, whole = rate(lambda: moving.move(one, next(steps)), seconds), rate(moving.refresh, seconds)
    touched = set(map(int, moving.lists.entries_of(int(one[0]))[0]))
    text = (
        f"One point moved: {1e6 / single:.0f} µs. All vertices computed again: {1e6 / whole:.0f} µs. "
        "Neighbouring cells are joined here where one list for both costs less."
    )
    return f"<p>{text}</p>" + cells(moving.mesh, domain, touched)


def image(data: bytes, kind: str, width: int) -> str:
    """A picture inside the page."""
    return f'<img width="{width}" src="data:image/{kind};base64,{base64.b64encode(data).decode()}">'


def quad_tree(variants: list[Variant]) -> str:
    """The uniform mesh and those of the quad tree that are as good."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "meshes.png"
        draw(variants, path, height=640)
        text = "The uniform mesh, and the smallest of the quad tree that deviates no more on 99 % of the area; "
        missing = {"by control points", "by chord error"} - {v.name for v in variants}
        text += f"{', '.join(sorted(missing))} none was found." if missing else "left to right."
        return f"<p>{text}</p>" + image(path.read_bytes(), "png", 380 * len(variants))


def experiment(head: Head, seconds: float) -> tuple[dict[str, float], str]:
    """Frames a second with everything moving, and pictures of expressions; without OpenGL only what is computed."""
    rng = np.random.default_rng(0)
    poses = cycle(rng.uniform(0, 0.5, (16, len(head.parameters))))
    frames = {"all vertices of a pose, every parameter moving": rate(lambda: head.pose(next(poses)), seconds)}
    try:
        screen = Offscreen(head, (300, 380))
    except ViewError as error:
        return frames, f"<p>No pictures: {escape(str(error))}</p>"
    with screen:
        shown = "".join(picture(screen.render(head.values(values)), name) for name, values in EXPRESSIONS.items())

        def frame() -> None:
            screen.draw(next(poses))
            screen.finish()

        frames["pictures of 300 x 380, every parameter moving"] = rate(frame, seconds)
    return frames, shown


def picture(pixels: np.ndarray, name: str) -> str:
    """Pixels (h, w, 3) and their name."""
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "webp", quality=85)
    shown = image(out.getvalue(), "webp", 205)
    return f"<figure style='display:inline-block;margin:4px'>{shown}<figcaption>{name}</figcaption></figure>"


if __name__ == "__main__":
    main()
