"""How little a pose of a head could cost where one parameter changes: what no engine with its surfaces can leave out.

Run ``python benchmarks/pose_bound.py [--head ict] [--rounds 60]``. A parameter rises from 0 to 1 in steps of an eighth.
The first table supposes that an engine knew beforehand which branches of the lists move by more than a millionth of the
head: it says which share of all weights it would still have to read, and how many vertices really move. The second
takes the times of what is then left: placing control points with all their corrections, and the sums of these branches
alone. They are timed in turn with whole poses, with warm caches and after other memory was written; each is the mean
over the steps of the least of all rounds. Of placing, the compiled parts that such an engine could not leave out
either are timed where they run: displacements of groups, lids on the eyeball, and the contacts whose own samples move
by more than a millionth of the head. With the sums they make the floor: no other part, no reading of parameters and
nothing of Python is in it. The third says why less is not known beforehand: how many weights are left where
displacements below a tenth of a millimetre are cut off, and how far a step moves the control points near each contact.
Times are from one run on one machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.table import Table

from controller.base.paths import find_config
from surface.base.arrays import Floats, Ints
from surface.bench.cold import FLUSHED_BYTES
from surface.deform.apply import compute_cells
from surface.deform.binding import address_table
from surface.head import Head
from surface.head.posing.contact import weights_at
from surface.head.posing.part import SkinPart

NAMES = ("eyeBlinkLeft", "browInnerUp", "jawOpen")
STEPS = 8
LEAST_MM = 2.5e-4  # below a millionth of the size of a head with neck and shoulders
FADED_MM = 0.1
GOAL_MS = 0.35


def skins(head: Head) -> list[SkinPart]:
    """The parts whose control points move one by one."""
    return [part for part in head.parts if isinstance(part, SkinPart)]


def rising(head: Head, name: str) -> list[Floats]:
    """Parameter values (P,) in which ``name`` rises from 0 to 1."""
    return [head.values({name: k / STEPS}) for k in range(STEPS + 1)]


def placed(head: Head, values: Floats) -> list[Floats]:
    """(m, 3) vertices of the deforming parts in a pose, before seams are closed."""
    pose = head.read_pose(values)
    _, turn = head.place_pose(pose, {})
    for part in skins(head):
        part.pose(pose, turn)
        part.deformation.refresh()  # seams have written to some vertices
    return [part.vertices[: len(part.mesh.vertices)].copy() for part in skins(head)]


def moving(before: list[Floats], after: list[Floats]) -> list[np.ndarray]:
    """(m,) bool for each part: which vertices move by more than :data:`LEAST_MM`."""
    return [np.linalg.norm(b - a, axis=1) > LEAST_MM for a, b in zip(before, after, strict=True)]


def moving_branches(part: SkinPart, moved: np.ndarray) -> Ints:
    """(k,) int32 branches of a part in which a vertex is ``moved (m,)``; a branch is a cell of the deformation."""
    start = part.deformation.mesh.cell_start
    return np.flatnonzero(np.logical_or.reduceat(moved, start[:-1])).astype(np.int32)


def share_of_weights(head: Head, branches: list[Ints]) -> float:
    """The part of all weights that the given branches of each part have."""
    work = [part.deformation.weights_of_cells for part in skins(head)]
    return float(sum(w[own].sum() for w, own in zip(work, branches, strict=True)) / sum(w.sum() for w in work))


def foresight(head: Head, name: str) -> list[tuple[float, float, list[Ints]]]:
    """For each step the share of weights that must be read, the share of vertices that move, and the branches."""
    found, poses = [], rising(head, name)
    before = placed(head, poses[0])
    for values in poses[1:]:
        after = placed(head, values)
        moved = moving(before, after)
        branches = [moving_branches(part, m) for part, m in zip(skins(head), moved, strict=True)]
        found.append((share_of_weights(head, branches), float(np.concatenate(moved).mean()), branches))
        before = after
    return found


class Sums:
    """Computes chosen branches of a head's deforming parts from their control points, and does nothing else."""

    def __init__(self, head: Head) -> None:
        own = [part.deformation for part in skins(head)]
        self._parts = [(d, address_table(d.addressed()), *d.work()[1:]) for d in own]

    def compute(self, branches: list[Ints]) -> None:
        """Compute ``branches (k,)`` of each part."""
        for (_, table, sign, rooms), cells in zip(self._parts, branches, strict=True):
            compute_cells(table, cells, 0, len(cells), sign, *rooms)


class Placing:
    """Times the compiled parts of placing a head's control points that a step cannot do without."""

    def __init__(self, head: Head) -> None:
        self._head = head
        self._spent: dict[str, float] = {}
        for part in skins(head):
            rig = part.rig
            self._watch(rig._moves, "add", f"{part.name}: groups")
            self._watch(rig._lids, "apply", f"{part.name}: lids")
            for solver in rig._solvers:
                self._watch(solver, "apply", solver.contact.name)
            for name, follower in rig._followers:
                self._watch(follower, "apply", f"{part.name}: {name}")

    def _watch(self, owner: object, method: str, label: str) -> None:
        """Time every call of a method."""
        own = getattr(owner, method)

        def timed(*given: object, **named: object) -> object:
            started = time.perf_counter()
            result = own(*given, **named)
            self._spent[label] = self._spent.get(label, 0.0) + 1e3 * (time.perf_counter() - started)
            return result

        setattr(owner, method, timed)

    def needed(self, before: Floats, after: Floats) -> list[str]:
        """Labels of what moves anything in a step: contacts with their followers are left out where no sample of theirs
        moves by more than :data:`LEAST_MM`."""
        at = []
        for values in (before, after):
            self._head.place_points(values)
            at.append({name: samples.copy() for name, samples in self._samples()})
        still = {c for c, old in at[0].items() if np.linalg.norm(at[1][c] - old, axis=1).max() <= LEAST_MM}
        return [label for label in self._spent if label.rpartition(": ")[2] not in still]

    def _samples(self) -> list[tuple[str, Floats]]:
        """(s, 3) samples of each contact as its solver placed them last, mm."""
        solvers = [solver for part in skins(self._head) for solver in part.rig._solvers]
        return [(solver.contact.name, solver._sides.samples[:, :3]) for solver in solvers]

    def least_time(self, name: str, rounds: int, flushed: int = 0) -> float:
        """Milliseconds that a step of ``name`` needs: the least of each label, added up, and their mean over the steps;
        ``flushed`` as :func:`least_times` takes it."""
        poses, other, found = rising(self._head, name), np.ones(max(flushed // 8, 1)), []
        for before, after in pairwise(poses):
            needed = self.needed(before, after)
            best = dict.fromkeys(needed, np.inf)
            for _ in range(rounds):
                self._head.place_points(before)
                if flushed:
                    other += 1.0
                self._spent.clear()
                self._head.place_points(after)
                best = {label: min(least, self._spent.get(label, 0.0)) for label, least in best.items()}
            found.append(sum(best.values()))
        return float(np.mean(found))


def least_times(head: Head, name: str, rounds: int, flushed: int = 0) -> Floats:
    """(3,) ms of a step of ``name``: a whole pose, placing its control points, the sums of the branches that move.

    flushed : bytes that are written elsewhere before each call.
    """
    poses, sums, other = rising(head, name), Sums(head), np.ones(max(flushed // 8, 1))
    steps = foresight(head, name)
    least = np.full((len(steps), 3), np.inf)
    for _ in range(rounds):
        for k, (_, _, branches) in enumerate(steps):
            calls: list[tuple[Callable[[Floats], object], Callable[[], object]]] = [
                (head.pose, lambda k=k: head.pose(poses[k + 1])),
                (head.place_points, lambda k=k: head.place_points(poses[k + 1])),
                (head.pose, lambda b=branches: sums.compute(b)),
            ]
            for row, (begin, call) in enumerate(calls):
                begin(poses[k])
                if flushed:
                    other += 1.0
                started = time.perf_counter()
                call()
                least[k, row] = min(least[k, row], 1e3 * (time.perf_counter() - started))
    return np.asarray(least.mean(axis=0))


def reached(head: Head, name: str, least_mm: float) -> float:
    """The part of all weights in branches that control points reach which a group moves by more than ``least_mm``."""
    branches = []
    for part, data in zip(skins(head), (p for p in head.data.parts if p.follows == "skin"), strict=True):
        ids = [g.ids[np.linalg.norm(g.moves, axis=1) > least_mm] for g in data.groups if g.name == name]
        lists, which = part.deformation.lists, np.unique(np.concatenate([*ids, np.zeros(0, np.int32)])).astype(np.int64)
        cells = [
            lists.point_cell[s : s + n] for s, n in zip(lists.point_start[which], lists.point_count[which], strict=True)
        ]
        branches.append(np.unique(np.concatenate([*cells, np.zeros(0, np.int32)])))
    return share_of_weights(head, branches)


def contact_steps(head: Head, name: str) -> dict[str, float]:
    """The furthest that groups and the jaw move a control point near each contact in one step, mm."""
    out: dict[str, float] = {}
    for contact in head.data.contacts:
        part = head.part(contact.part)
        ids = np.unique(weights_at(part.surface, contact.places.reshape(-1, 2))[1])
        points = [part.place_points(head.read_pose(values))[ids].copy() for values in rising(head, name)]
        steps = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1)
        out[contact.name] = float(np.median(steps))
    return out


def foresight_table(head: Head, console: Console) -> None:
    """Shares of weights and vertices, from the least to the greatest of all steps."""
    table = Table("step of", "weights to read", "vertices that move", title="with perfect foresight, of all")
    for name in NAMES:
        weights, vertices, _ = zip(*foresight(head, name), strict=True)
        table.add_row(name, f"{min(weights):.0%} to {max(weights):.0%}", f"{min(vertices):.0%} to {max(vertices):.0%}")
    console.print(table)


def time_table(head: Head, rounds: int, console: Console) -> None:
    """Least times of a pose, and what is left of it with perfect foresight."""
    columns = ("step of", "caches", "pose, ms", "placing points", "of that needed", "sums", "floor, ms", "goal, ms")
    table = Table(*columns, title="least times, and their parts of the whole pose")
    watched = Placing(Head(head.data))
    for name in NAMES:
        for caches, flushed in (("warm", 0), ("cold", FLUSHED_BYTES)):
            times = rounds if not flushed else max(rounds // 4, 1)
            whole, placing, sums = least_times(head, name, times, flushed)
            needed = watched.least_time(name, times, flushed)
            parts = [f"{part:.2f} ({part / whole:.2f})" for part in (placing, needed, sums)]
            table.add_row(name, caches, f"{whole:.2f}", *parts, f"{needed + sums:.2f}", f"{GOAL_MS}")
    console.print(table)


def unknown_table(head: Head, console: Console) -> None:
    """What is not known before control points are placed."""
    title = f"weights that a group reaches, and without moves below {FADED_MM} mm; moves near contacts, mm a step"
    contacts = [c.name for c in head.data.contacts]
    table = Table("step of", "weights", "without", *contacts, title=title)
    for name in NAMES:
        moves = contact_steps(head, name)
        shares = [f"{reached(head, name, least):.0%}" for least in (0.0, FADED_MM)]
        table.add_row(name, *shares, *(f"{moves[c]:.2f}" for c in contacts))
    console.print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--head", default="ict")
    parser.add_argument("--rounds", type=int, default=60)
    arguments = parser.parse_args()
    head, console = Head.load(find_config("heads", arguments.head)), Console()
    foresight_table(head, console)
    time_table(head, arguments.rounds, console)
    unknown_table(head, console)


if __name__ == "__main__":
    main()
