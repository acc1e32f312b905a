"""Skin that passes through itself, through eyeballs or teeth, at rest and with every shape at 1.

Only skin counts that can be seen from outside at rest: what lines the mouth may overlap the teeth as it likes. The
depth of an overlap is the one that is exceeded over 10 mm² of skin: single vertices that lie deeper, as in the corners
of mouth and eyes, are not seen. Flesh lies between skin and what lines the mouth, and is left through either: without
the lining, a lip that reaches a little into the other would be as deep in it as the chin or the nose is away. What
lines the lids ends inside the eyeballs, where nobody sees how it folds, and does not count either.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.check.cells import joined_nearer
from surface.check.crossings import NO_KIND, Crossings
from surface.check.findings import AGAIN, Finding
from surface.check.mouth import find_mouth
from surface.check.places import Places
from surface.check.sight import are_visible
from surface.check.subject import Subject
from surface.head import Head
from surface.head.model.data import HeadData
from surface.head.model.parameters import SHAPES

# Materials that skin may not pass through, and by how much it may, mm at usual size. Lips are pressed against teeth and
# rolled round them in many shapes, where nobody sees it: teeth are looked at at rest and with an open jaw.
LIMITS_MM = {"skin": 4.0, "eye": 2.0, "teeth": 2.0}
TEETH_SHAPES = ("", "jawOpen")  # in which overlaps with teeth are checked; "" is the neutral face
MAX_DEPTH_MM = 12.0  # of an overlap that is measured
MIN_DEPTH_MM = 0.3
MIN_REPORTED_MM = 1.0  # overlaps below this are not reported at the end of a fit
TOGETHER_MM = 8.0  # vertices no further apart than that lie about one place
DEEPER_MM = 0.5  # than in the neutral face: what is less belongs to that
AREA_MM2 = 10.0
LINING = "mouth"  # material of what lines the mouth: flesh lies between it and the skin
INSIDE_SHARE = 0.2  # of a part's vertices at rest: with more of them inside an eyeball, it lines the lids
MOVED_MM = 0.1  # what moves less counts as unmoved
WORDS = {"skin": "itself", "eye": "the eyeball", "teeth": "the teeth"}


@dataclass(frozen=True)
class Overlap:
    """How deep skin lies behind a material in a shape ("" at rest), mm, and where, in words; ``limit`` : mm. at : (3,)
    the place at rest."""

    mm: float
    material: str
    shape: str
    place: str
    limit: float
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __str__(self) -> str:
        shape = f"shape {self.shape}" if self.shape else "the neutral face"
        return f"{self.mm:.1f} mm: skin passes through {WORDS[self.material]}: {shape}, {self.place}"


def overlaps(subject: Subject, places: Places) -> list[Overlap]:
    """Return the deepest overlap of skin with each material, over all shapes; deepest relative to its limit first."""
    found: dict[str, Overlap] = {}
    body = _Body(subject)
    for shape in ("", *(n for n in subject.claimed if n in SHAPES)) if len(body.numbers) else ():
        for one in body.overlaps(shape, places):
            found[one.material] = max(found.get(one.material, one), one, key=lambda o: o.mm)
    return sorted(found.values(), key=lambda o: -o.mm / o.limit)


def overlapping(subject: Subject, places: Places) -> Iterator[Finding]:
    """Find overlaps beyond their limits. Skin in itself is a warning: folds of lips and ears do that on good heads,
    too."""
    for one in overlaps(subject, places):
        if one.mm > one.limit:
            text, hint = f"{one} ({one.limit:.1f} mm at most)", f"correct the shape in the mesh, then {AGAIN}"
            yield Finding("overlap", text, hint, warning=one.material == "skin")


def overlap_notes(head: HeadData, in_mesh: Callable[[Overlap], float] = lambda _: 0.0) -> list[str]:
    """Return the deepest overlap of a head's skin with each material, in words; none where all are shallow.

    in_mesh : how deep the same overlap is in the mesh that the head was fitted to, mm; 0 where it has none.
    """
    subject = Subject(Head(head))
    found = overlaps(subject, Places(subject, find_mouth(subject)))
    return [_told(one, in_mesh(one)) for one in found if one.mm > MIN_REPORTED_MM * subject.scale]


def _told(overlap: Overlap, in_mesh: float) -> str:
    """Return an overlap in words, with how deep it is in the mesh where that has it, too."""
    return f"{overlap}; in the mesh itself {in_mesh:.1f} mm" if in_mesh > 0.0 else str(overlap)


def _lines_lids(subject: Subject, number: int) -> bool:
    """Whether a part goes from the lids into the eyeballs."""
    if subject.eyes is None:
        return False
    off = np.linalg.norm(subject.rest[number][:, None] - subject.eyes, axis=2).min(axis=1)
    return bool((off < subject.head.data.eye_radius).mean() > INSIDE_SHARE)


class _Body:
    """Skin, eyeballs and teeth of a head as one mesh."""

    def __init__(self, subject: Subject) -> None:
        self._subject, self._kinds = subject, [*LIMITS_MM, LINING]
        met = [k for k, p in enumerate(subject.parts) if p.material in self._kinds and len(p.triangles)]
        drawn = [k for k in met if subject.parts[k].material != "skin" or not _lines_lids(subject, k)]
        self.numbers = drawn if any(subject.parts[k].material == "skin" for k in drawn) else []
        if not self.numbers:
            return
        parts = [subject.parts[k] for k in self.numbers]
        starts = np.cumsum([0, *(len(subject.rest[k]) for k in self.numbers)])
        triangles = np.concatenate([p.triangles.astype(np.int64) + s for p, s in zip(parts, starts, strict=False)])
        kind = np.concatenate([np.full(len(p.triangles), self._kinds.index(p.material)) for p in parts])
        self._rest = self._at(subject.rest)
        cells = np.round(self._rest / (1e-3 * subject.scale))
        same = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
        meets = np.zeros((len(self._kinds),) * 2, bool)
        meets[0, :-1] = meets[:-1, 0] = True
        seen = are_visible(self._rest, triangles, subject.scale) & (kind == 0)
        self._crossings = Crossings(self._rest, triangles, same, kind, meets, seen)
        self._area = self._areas(triangles[seen], same)
        self._at_rest = np.zeros((len(self._kinds), len(self._rest)))  # depths, once the neutral face was looked at

    def _at(self, vertices: list[Floats32]) -> Floats:
        return np.concatenate([vertices[k] for k in self.numbers]).astype(np.float64)

    def _areas(self, triangles: Ints, same: Ints) -> Floats:
        """Return (n,): mm² of triangles that belongs to each vertex at rest; of those in one place together."""
        a, b, c = (self._rest[triangles[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
        whole: Floats = np.bincount(same[triangles].ravel(), np.repeat(area, 3), len(self._rest)).astype(np.float64)
        return whole[same]

    def overlaps(self, shape: str, places: Places) -> Iterator[Overlap]:
        """Return the overlaps of one shape, by material; "" comes first. Of a shape only that counts which is deeper
        than in the neutral face: ears that hair hides pass through themselves in any."""
        subject, scale = self._subject, self._subject.scale
        at = self._at(subject.at_one(shape) if shape else subject.rest)
        pairs = self._crossings.pairs(at, least=MOVED_MM * scale if shape else -1.0)
        for material, limit in LIMITS_MM.items():
            if material == "teeth" and shape not in TEETH_SHAPES:
                continue
            kind = self._kinds.index(material)
            least, most = MIN_DEPTH_MM * scale, MAX_DEPTH_MM * scale
            lining = self._kinds.index(LINING) if material == "skin" else NO_KIND
            rows, depth = self._crossings.depths(pairs, 0, kind, most, least, lining)
            if shape:
                deeper = depth > self._at_rest[kind][rows] + DEEPER_MM * scale
                rows, depth = rows[deeper], depth[deeper]
            else:
                self._at_rest[kind][rows] = depth
            if (row := self._deepest(rows, depth)) is not None:
                x, y, z = self._rest[rows[row]].tolist()
                place = places.name(self._rest[rows[row]])
                yield Overlap(float(depth[row]), material, shape, place, limit * scale, (x, y, z))

    def _deepest(self, rows: Ints, depth: Floats) -> int | None:
        """Return the place among vertices (k,) whose depth is exceeded over enough area about one place; None where
        no place has that much."""
        if not len(rows):
            return None
        scale, order = self._subject.scale, np.argsort(-depth)
        places = np.asarray(self._rest[rows], np.float64)
        label = joined_nearer(places, np.arange(len(rows)), TOGETHER_MM * scale)[order]
        for k, row in enumerate(order.tolist()):
            near = order[: k + 1][label[: k + 1] == label[k]]
            if self._area[rows[near]].sum() >= AREA_MM2 * scale**2:
                return int(row)
        return None
