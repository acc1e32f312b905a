"""Non-rigid registration of a template to a scan: iterated closest points with a map of decreasing stiffness.

As in Amberg et al. (2007), Optimal Step Nonrigid ICP, closest points are accepted by distance and normal, and never at
the scan's borders, so that holes do not attract the surface. The map moves all of space
(:mod:`surface.fit.transfer.warp`). The registrations of trimesh are not used, since they move each vertex by itself and
match the borders of holes, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.transfer.align import thinned
from surface.fit.transfer.detail.below_neck import neck_place, neck_share
from surface.fit.transfer.place_parts import ScaleShift, fit_scale_shift
from surface.fit.transfer.relief import Finder
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp
from surface.head.model.parameters import smoothstep


@dataclass(frozen=True)
class Stage:
    """Some iterations with the same settings.

    stiffness : of the map. farthest : greatest distance of a match, mm. steps : number of iterations.
    search : before the iterations landmarks are searched for up to so many mm away; 0: they are not.
    single : each landmark is searched for by itself.
    """

    stiffness: float
    farthest: float
    steps: int
    search: float = 0.0
    single: bool = False


STAGES = (
    Stage(30000.0, 25.0, 4), Stage(20000.0, 20.0, 4, 16.0), Stage(5000.0, 16.0, 4, 8.0), Stage(1500.0, 14.0, 4, 5.0),
    Stage(500.0, 10.0, 5, 4.0, True), Stage(200.0, 8.0, 5, 3.0, True), Stage(60.0, 6.0, 5),
)  # fmt: skip
FEATURE_MM, FEATURES, FACE, REST = 26.0, 800, 350, 260  # nodes near eyes, mouth and nose; on the face; elsewhere
NORMAL_MM = 14.0  # distance that a difference of normals by 1 counts as in the search for closest points
LEAST_COSINE = 0.5  # between the two normals of a match
SMOOTH = 500.0  # least stiffness of the smooth map
STILL = 0.002  # weight of a node without a match, which is kept in its place
FAR, FAR_MM = 0.05, (12.0, 40.0)  # the same far from every match; distances where it begins and where it is complete
LANDMARK, FOUND = 30.0, (10.0, 1.5)  # weight of a given landmark; of one found together with others, of one found alone
SLIDE = 0.35  # how much of the tangential part of a match is used; the normal part is used fully


@dataclass(frozen=True)
class Mark:
    """A landmark on a scan.

    place : (3,). how : ``given`` by hand, ``found`` in the relief, or ``carried`` there by the map, which follows its
    neighbours. sure : confidence in a found one, 0..1.
    """

    place: Floats
    how: str
    sure: float = 1.0


@dataclass(frozen=True)
class Registered:
    """The map from a template to a scan, a stiffer one, and the scan's landmarks by name."""

    warp: Warp
    smooth: Warp
    marks: dict[str, Mark]


@dataclass(frozen=True)
class Matches:
    """For n points: ``found (n,)``, whether each has a match on the scan; ``goals (n, 3)``, where it should move."""

    found: Bools
    goals: Floats


class Matcher:
    """Finds points of a scan for points of a surface near it."""

    def __init__(self, samples: Samples) -> None:
        self._samples = samples
        self._tree = cKDTree(np.hstack([samples.points, NORMAL_MM * samples.normals]))

    def find(self, at: Floats, normals: Floats, farthest: float, slide: float) -> Matches:
        """Matches for points (n, 3) with unit normals (n, 3), none farther than ``farthest`` mm.

        slide : 0..1, how much of the tangential part of the way to the match is used.
        """
        _, near = self._tree.query(np.hstack([at, NORMAL_MM * normals]))
        there, out = self._samples.points[near], self._samples.normals[near]
        off = there - at
        cosine = (out * normals).sum(axis=1)
        found = (np.linalg.norm(off, axis=1) < farthest) & (cosine > LEAST_COSINE) & ~self._samples.border[near]
        along = (off * out).sum(axis=1)[:, None] * out
        return Matches(found, at + along + slide * (off - along))


def choose_nodes(template: Template) -> Ints:
    """Indices of the template's points that are nodes of the map: dense at eyes, mouth and nose, sparse elsewhere."""
    marks = np.array([p for n, p in template.landmarks.items() if n != "chin"])
    distance = cKDTree(marks).query(template.points)[0]
    features = distance < FEATURE_MM
    regions = ((features, FEATURES), (template.face & ~features, FACE), (~template.face & ~features, REST))
    every = ((np.flatnonzero(own), count) for own, count in regions)  # a head may be nothing but a face
    return np.concatenate([ids[thinned(template.points[ids], count)] for ids, count in every if len(ids)])


class Registration:
    """Iterations from a template to the samples of a scan, which is aligned with it.

    given : places (3,) of landmarks on the scan by the template's names; the others are searched for in the relief.
    """

    def __init__(self, template: Template, samples: Samples, given: dict[str, Floats]) -> None:
        self._template, self._given = template, given
        self._nodes = choose_nodes(template)
        self._names = list(template.landmarks)
        self._marks = np.array([template.landmarks[n] for n in self._names])
        self._goals = self._marks.copy()
        self._held = np.full(len(self._names), STILL)
        self._sure: dict[str, float] = {}
        for k, name in enumerate(self._names):
            if name in given:
                self._goals[k], self._held[k] = given[name], LANDMARK
        self._matcher, self._finder = Matcher(samples), Finder(template, samples)
        points = template.points[self._nodes]
        self._centres = np.vstack([points, self._marks])
        still = np.append(np.full(len(points), STILL), self._held)
        self.warp = Warp(self._centres, np.vstack([points, self._goals]), still, STAGES[0].stiffness)
        self._stiffer = self.warp

    def find_landmarks(self, search: float, single: bool) -> None:
        """Search for landmarks up to ``search`` mm from where the map puts them now, each by itself if ``single``."""
        at = self.warp(np.vstack([self._template.points, self._marks]))
        marks = dict(zip(self._names, at[len(self._template.points) :], strict=True))
        find = self._finder.refine if single else self._finder.find
        found = find(at[: len(self._template.points)], marks, search)
        for k, name in enumerate(self._names):
            if name in found and name not in self._given:
                self._goals[k], sure = found[name]
                self._held[k] = FOUND[single] * sure**2
                self._sure[name] = sure

    def marks(self) -> dict[str, Mark]:
        """Every landmark where it was given or found, else where the map puts it now."""
        carried = self.warp(self._marks)
        return {
            name: Mark(self._goals[k].copy(), "given") if name in self._given
            else Mark(self._goals[k].copy(), "found", self._sure[name]) if name in self._sure
            else Mark(carried[k], "carried", 0.0)
            for k, name in enumerate(self._names)
        }  # fmt: skip

    def keep_unmatched(self) -> None:
        """From now on, nodes without a match stay where the present map puts them."""
        self._stiffer = self.warp

    def step(self, stiffness: float, farthest: float) -> None:
        """One iteration: match the nodes, then fit the map to the matches."""
        template, nodes = self._template, self._nodes
        at, out = self.warp.turned(template.points[nodes], template.normals[nodes])
        match = self._matcher.find(at, out, farthest, SLIDE)
        off = np.linalg.norm(match.goals - at, axis=1)
        weight = np.where(match.found, 1.0 / (1.0 + (2.0 * off / farthest) ** 2), STILL)
        goals, weight = self._unmatched(match.goals, weight, match.found)
        goals = np.vstack([goals, self._goals])
        self.warp = Warp(self._centres, goals, np.append(weight, self._held), stiffness)

    def _unmatched(self, goals: Floats, weight: Floats, found: Bools) -> tuple[Floats, Floats]:
        """Goals (n, 3) and weights (n,) of all nodes.

        Nodes without a match stay where a stiffer map put them. Those far from every match, such as the back of a head
        of which only the face was scanned, follow the scale and shift of all matches; below the end of a neck, those
        of the neck.
        """
        points = self._template.points[self._nodes]
        if found.sum() < 4:
            return points, weight
        whole = fit_scale_shift(points[found], goals[found])
        far = smoothstep(cKDTree(points[found]).query(points)[0], *FAR_MM)[:, None]
        place = (1.0 - far) * self._stiffer(points) + far * self._placed(points, goals, found, whole)
        held = STILL + (FAR - STILL) * far[:, 0]
        return np.where(found[:, None], goals, place), np.where(found, weight, held)

    def _placed(self, points: Floats, goals: Floats, found: Bools, whole: ScaleShift) -> Floats:
        """(n, 3) where points (n, 3) lie by the scale and shift of all matches, and of the neck's below it."""
        placed, neck = whole.points(points), self._template.neck
        if neck is None:
            return placed
        share = neck_share(points, neck)[:, None]
        return (1.0 - share) * placed + share * neck_place(points, goals, found, neck, whole).points(points)


def register(
    template: Template, samples: Samples, given: dict[str, Floats], progress: Callable[[float], None]
) -> Registered:  # fmt: skip
    """The map of space from a template to the samples of a scan, which is aligned with it.

    given : places (3,) of landmarks on the scan by the template's names.
    """
    run = Registration(template, samples, given)
    smooth = run.warp
    for k, stage in enumerate(STAGES):
        run.keep_unmatched()
        if stage.search:
            run.find_landmarks(stage.search, stage.single)
        for _ in range(stage.steps):
            run.step(stage.stiffness, stage.farthest)
        if stage.stiffness >= SMOOTH:
            smooth = run.warp
        progress((k + 1) / len(STAGES))
    return Registered(run.warp, smooth, run.marks())
