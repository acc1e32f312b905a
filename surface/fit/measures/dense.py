"""Errors of a fitted head as it is really posed: distances of dense samples from the surface to the mesh and back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.check.mouth import find_mouth
from surface.check.places import Places
from surface.check.subject import Subject
from surface.fit.measures.closest import ClosestTree
from surface.fit.measures.inside_out import InsideOutFaces
from surface.fit.measures.mesh_pose import displacement
from surface.fit.measures.purposes import RIGID, moved_as_a_whole, without_changes
from surface.fit.points.report import NEUTRAL, Both, DenseErrors, Errors, FittedPart, Spot, Turned, errors_of
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh, triangles
from surface.head import Head
from surface.head.model.data import HeadData, PartData
from surface.head.model.meshes import domain_of

NO_TRIANGLES = np.zeros((0, 3), np.int64)


class _Pair:
    """A part of the head and the faces of the mesh that it was fitted to, with samples of both.

    data : the part as it is drawn; what its outlines cut off has no samples on the mesh.
    rest : samples of the surface and of the mesh at rest, each (m, 3).
    """

    def __init__(self, part: FittedPart, data: PartData, number: int, subject: Subject, mesh: FitMesh) -> None:
        self.name, self.number, self.material = part.name, number, subject.parts[number].material
        self.follows = data.follows
        self._uv = np.asarray(subject.parts[number].uv, np.float64)
        faces = mesh.faces[faces_of(mesh, part.chart)]
        self.turned = InsideOutFaces(part, subject.parts[number])
        shown, every = ~_cut_off(mesh, part, data), triangles(faces)
        self._cut = subject.parts[number].triangles.astype(np.int64), every[shown[every].all(axis=1)]
        self._used = np.unique(self._cut[0]), np.unique(every)[shown[np.unique(every)]]
        at = subject.rest[number].astype(np.float64), mesh.vertices
        self._trees = ClosestTree(at[0], self._cut[0]), ClosestTree(at[1], every)
        self._near = [np.zeros(len(t) + len(u), np.int64) for t, u in zip(self._cut, self._used, strict=True)]
        self.rest = self._samples(0, at[0]), self._samples(1, at[1])
        folded = _folded(mesh, part)
        flat, whole = (np.asarray(folded[cut].any(axis=1), bool) for cut in (self._cut[1], every))
        self._bridges = _bridges(part, self._samples(0, np.pad(self._uv, ((0, 0), (0, 1))))[:, :2])
        self._fold_of, self._fold_at = whole[self._trees[1].order], np.concatenate([folded[self._used[1]], flat])

    def _samples(self, k: int, vertices: Floats) -> Floats:
        """Vertices and centres of triangles of the head's part (0) or of the mesh (1)."""
        at = np.asarray(vertices, np.float64)
        return np.concatenate([at[self._used[k]], at[self._cut[k]].mean(axis=1)])

    def distances(self, surface: Floats, mesh: Floats) -> list[tuple[Floats, Bools]]:
        """From the surface's samples to the mesh, and from the mesh's to the surface, mm, and which lie in folds."""
        for tree, vertices in zip(self._trees, (surface, mesh), strict=True):
            tree.move(vertices)
        to_mesh = self._trees[1].distances(self._samples(0, surface), self._near[0])
        to_surface = self._trees[0].distances(self._samples(1, mesh), self._near[1])
        return [(to_mesh, self._fold_of[self._near[0]] | self._bridges), (to_surface, self._fold_at)]

    def greater_elsewhere(
        self, surface: Floats, mesh: Floats, before: Floats, found: list[tuple[Floats, Bools]], least: float
    ) -> list[tuple[Floats, Bools]]:
        """As :meth:`distances` with the surface's vertices elsewhere, but only what is more than ``least``, the rest 0.

        found : what :meth:`distances` found right before with the same mesh and the vertices ``before (m, 3)``. A
        distance grows at most by as much as the sample, or the triangle nearest to it, moves: few have to be computed.
        """
        (to_mesh, fold), (to_surface, fold_at) = found
        moved, tree, near = np.linalg.norm(surface - before, axis=1), self._trees[0], self._near[1]
        most = np.concatenate([moved[self._used[0]], moved[self._cut[0]].max(axis=1, initial=0.0)])
        rows = (
            np.flatnonzero(to_mesh + most > least),
            np.flatnonzero((to_surface + moved[tree.triangles].max(axis=1, initial=0.0)[near] > least) & ~fold_at),
        )
        out, fold = (np.zeros_like(to_mesh), np.zeros_like(to_surface)), fold.copy()
        if len(rows[0]):
            there = self._near[0][rows[0]]
            out[0][rows[0]] = self._trees[1].distances(self._samples(0, surface)[rows[0]], there)
            fold[rows[0]] = self._fold_of[there] | self._bridges[rows[0]]
        if len(rows[1]):
            tree.move(surface)
            out[1][rows[1]] = tree.distances(self._samples(1, mesh)[rows[1]], near[rows[1]])
        return [(out[0], fold), (out[1], fold_at)]

    def furthest(self, before: Floats, after: Floats, shape: str, places: Places) -> Spot:
        """The vertex that moves furthest between two poses (m, 3)."""
        moved = np.linalg.norm(after - before, axis=1)[self._used[0]]
        row = int(moved.argmax())
        return Spot(float(moved[row]), shape, self.name, places.name(self.rest[0][row], self.material), True)

    def furthest_of_mesh(self, before: Floats, after: Floats, shape: str, places: Places) -> Spot:
        """The vertex of the mesh that is furthest from itself in two poses (n, 3)."""
        moved = np.linalg.norm(after - before, axis=1)[self._used[1]]
        row = int(moved.argmax()) if len(moved) else 0
        far = float(moved[row]) if len(moved) else 0.0
        return Spot(far, shape, self.name, places.name(self.rest[1][row], self.material), False)

    def sticking(self, to_mesh: Floats, fold: Bools, limit: float) -> Floats:
        """(k, 2) in (u, v): the surface's vertices that are further from the mesh than ``limit``, outside folds."""
        used = self._used[0]
        rows = used[(to_mesh[: len(used)] > limit) & ~fold[: len(used)]]
        return self._uv[rows[rows < len(self._uv)]]


class _ContactMoves:
    """How far the contacts of a head move its vertices on purpose, by the same head without them.

    most : the vertices that are moved furthest, mm: to keep sides out of each other, and to keep lips together.
    """

    def __init__(self, head: HeadData) -> None:
        self._without = Subject(Head(replace(head, contacts=[])))
        self._unsealed = Subject(Head(replace(head, contacts=[replace(c, seal=None) for c in head.contacts])))
        self.most: list[Spot | None] = [None, None]

    def compare(self, pair: _Pair, surface: Floats, shape: str, places: Places) -> Floats:
        """Return vertices (m, 3) of one part without contacts; ``surface (m, 3)`` are those with contacts."""
        alone, parted = (_posed(s, shape, pair.number) for s in (self._without, self._unsealed))
        for k, (before, after) in enumerate(((alone, parted), (parted, surface))):
            self.most[k] = _greater(self.most[k], pair.furthest(before, after, shape, places))
        return alone


class _OnPurpose:
    """Finds how far a head goes otherwise than its mesh on purpose, see :mod:`.purposes`.

    whole : the head with the rules that change shapes; None if that is not asked for. changed : these shapes.
    otherwise, stiff : the furthest place that a rule moves, and that a part leaves out which follows skull or jaw.
    """

    def __init__(self, whole: HeadData | None, changed: list[str]) -> None:
        self._shown = None if whole is None else Subject(Head(whole))
        self._changed = changed
        self.otherwise: Spot | None = None
        self.stiff: Spot | None = None

    def follow(self, pair: _Pair, mesh: FitMesh, own: Floats, shape: str, subject: Subject, places: Places) -> Floats:
        """Return vertices (n, 3) of the mesh as a part is meant to show them; ``own (n, 3)`` are those of the shape."""
        if pair.follows not in RIGID:
            return own
        moved = moved_as_a_whole(subject, pair.follows, mesh.vertices, shape)
        self.stiff = _greater(self.stiff, pair.furthest_of_mesh(own, moved, shape, places))
        return moved

    def compare(self, pair: _Pair, surface: Floats, shape: str, places: Places) -> None:
        """Note how far the rules move ``surface (m, 3)``, the vertices of one part without them."""
        if self._shown is not None and shape in self._changed:
            both_ways = surface, _posed(self._shown, shape, pair.number)
            self.otherwise = _greater(self.otherwise, pair.furthest(*both_ways, shape, places))


def measure_dense(
    head: HeadData, mesh: FitMesh, sources: dict[str, list[int]], parts: Sequence[FittedPart], limit: float = np.inf,
    *, fit_alone: bool = False,
) -> DenseErrors:  # fmt: skip
    """Distances between a head and the mesh that it was fitted to, in neutral and with each of its shapes at 1.

    The head is posed as it always is, with its jaw, eyes, contacts and wrinkles, but without what changes a shape of
    the mesh on purpose (:mod:`.purposes`): what that is, and how far it goes, is said. Samples are all vertices and
    centres of triangles on both sides; each part is compared with the faces that it was fitted to, folds apart.
    sources : by parameter, the shapes of the mesh that add up to it. limit : mm, from which a vertex sticks out.
    fit_alone : find the greatest error of what was fitted alone, without contacts, too, where the head has contacts;
        and how far the head is moved on purpose.
    """
    whole, (head, changed) = head, without_changes(head)
    subject = Subject(Head(head))
    purposes = _OnPurpose(whole if fit_alone and changed else None, changed)
    free = _ContactMoves(head) if fit_alone and head.contacts else None
    places = Places(subject, find_mouth(subject))
    numbers = {p.name: k for k, p in enumerate(subject.parts)}
    owned = [faces_of(mesh, p.chart) for p in parts]
    data = {p.name: p for p in head.parts}
    fitted = [p for p, own in zip(parts, owned, strict=True) if own.any()]
    pairs = [_Pair(p, data[p.name], numbers[p.name], subject, mesh) for p in fitted]
    found: dict[str, dict[str, Both]] = {p.name: {} for p in pairs}
    worst: dict[bool, Spot] = {}
    apart: Spot | None = None
    sticking: dict[tuple[str, str], Floats] = {}
    turned: dict[tuple[str, str], Turned] = {}
    for shape in (NEUTRAL, *(n for n in sources if n in subject.claimed)):
        own = mesh.vertices + displacement(mesh, sources, shape, head.jaw)
        for pair in pairs:
            surface = _posed(subject, shape, pair.number)
            moved = purposes.follow(pair, mesh, own, shape, subject, places)
            purposes.compare(pair, surface, shape, places)
            both = pair.distances(surface, moved)
            if len(places_out := pair.sticking(*both[0], limit)):
                sticking[pair.name, shape] = places_out
            over = Turned(*pair.turned.find(surface, moved))
            if over.mm2 > 0.0:
                turned[pair.name, shape] = over
            in_folds = np.concatenate([d[fold] for d, fold in both])
            found[pair.name][shape] = Both(*_outside_folds(both), errors_of(in_folds))
            for spot, fold in _greatest(pair, both, shape, places, pair.material):
                worst[fold] = _greater(worst.get(fold), spot)
            if free is not None:
                alone = free.compare(pair, surface, shape, places)
                greater = pair.greater_elsewhere(alone, moved, surface, both, apart.mm if apart else 0.0)
                for spot, fold in _greatest(pair, greater, shape, places, pair.material):
                    apart = apart if fold else _greater(apart, spot)
    rest = ~np.any([*owned, np.zeros(len(mesh.faces), bool)], axis=0)
    added = tuple(p.name for p in subject.parts if p.name not in found)
    samples = sum(len(r) for p in pairs for r in p.rest)
    parted, sealed = free.most if free is not None else (None, None)
    return DenseErrors(
        found, worst.get(False), worst.get(True), added, _pieces(mesh, rest), samples, sticking, turned,
        tuple(n for n in changed if n in sources), apart, parted, sealed,
        purposes.otherwise, purposes.stiff,
    )  # fmt: skip


def _posed(subject: Subject, shape: str, number: int) -> Floats:
    """(m, 3) vertices of one part at rest or with a shape at 1."""
    posed = subject.rest if shape == NEUTRAL else subject.at_one(shape)
    return posed[number].astype(np.float64)


def _greater(one: Spot | None, other: Spot) -> Spot:
    return other if one is None or other.mm > one.mm else one


def _outside_folds(both: list[tuple[Floats, Bools]]) -> tuple[Errors, Errors]:
    to_mesh, to_surface = (errors_of(distance[~fold]) for distance, fold in both)
    return to_mesh, to_surface


def _greatest(
    pair: _Pair, both: list[tuple[Floats, Bools]], shape: str, places: Places, material: str
) -> Iterator[tuple[Spot, bool]]:  # fmt: skip
    """The greatest errors of a part in one shape, both ways, outside and inside folds, and whether inside."""
    for k, (distance, fold) in enumerate(both):
        for inside in (False, True):
            rows = np.flatnonzero(fold == inside)
            if len(rows):
                row = int(rows[distance[rows].argmax()])
                place = places.name(pair.rest[k][row], material)
                yield Spot(float(distance[row]), shape, pair.name, place, k == 0), inside


def errors_at_rest(head: HeadData, mesh: FitMesh, charts: Mapping[str, Chart]) -> dict[str, Floats]:
    """By part of a head, (m,) mm from each of its vertices at rest to the faces of the mesh that its chart samples.

    charts : of the parts that were fitted, by name. Vertices that no triangle has are NaN.
    """
    subject, out = Subject(Head(head)), dict[str, Floats]()
    for part, rest in zip(subject.parts, subject.rest, strict=True):
        cut = triangles(mesh.faces[faces_of(mesh, charts[part.name])]) if part.name in charts else NO_TRIANGLES
        if len(cut):
            used = np.unique(part.triangles)
            out[part.name] = np.full(len(rest), np.nan)
            tree = ClosestTree(mesh.vertices, cut)
            out[part.name][used] = tree.distances(rest[used].astype(np.float64), np.zeros(len(used), np.int64))
    return out


def faces_of(mesh: FitMesh, chart: Chart) -> Bools:
    """(f,) the faces that a chart samples: those whose corners it all uses."""
    used = np.zeros(len(mesh.vertices) + 1, bool)
    used[chart.mix.indices] = True
    used[-1] = True  # the missing fourth corner of triangles
    return np.asarray(used[mesh.faces].all(axis=1))


def _folded(mesh: FitMesh, part: FittedPart) -> Bools:
    """(n,) vertices of the mesh that lie in folds of a chart, which its fit holds only loosely."""
    mix = part.chart.mix
    alone = np.diff(mix.indptr) == 1  # samples that are a vertex
    out = np.zeros(len(mesh.vertices), bool)
    out[mix.indices[mix.indptr[:-1][alone & part.chart.folded]]] = True
    out[part.chart.inner] = True
    return out


def _bridges(part: FittedPart, uv: Floats) -> Bools:
    """(m,) which places of a wrapped skin span a gap of the mesh, as below the root of a tongue; of no other part."""
    chart = part.chart
    if not len(chart.inner):
        return np.zeros(len(uv), bool)
    return np.asarray(chart.folded[cKDTree(chart.uv).query(uv)[1]], bool)


def _cut_off(mesh: FitMesh, part: FittedPart, data: PartData) -> Bools:
    """(n,) vertices of the mesh that are not drawn: its outlines were narrowed to what a texture shows, or to hairs."""
    out, chart = np.zeros(len(mesh.vertices), bool), part.chart
    if len(data.loops) == len(chart.loops) and all(map(np.array_equal, data.loops, chart.loops)):
        return out
    alone = np.flatnonzero(np.diff(chart.mix.indptr) == 1)
    gone = alone[~domain_of(data).inside(chart.uv[alone])]
    out[chart.mix.indices[chart.mix.indptr[gone]]] = True
    return out


def _pieces(mesh: FitMesh, faces: Bools) -> tuple[str, ...]:
    """Names of the objects that faces (f,) belong to, with their number."""
    rows = np.flatnonzero(faces)
    names = [mesh.piece_of(int(r)) or "unnamed" for r in rows]
    return tuple(f"{n} ({names.count(n)} faces)" for n in sorted(set(names)))
