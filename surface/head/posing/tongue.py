"""Contact of a tongue that is put out: it rests on the lower lip and the lower teeth, below the upper teeth.

Stations are places on the tongue's upper and under side, several in each of its cross-sections. Stations of the
underside are compared with samples of the lower lip, after the contact of the lips was solved, and of the lower teeth.
Each cross-section is lifted by as much as its lowest station is too low, smoothed along the tongue. Where the upper
side then meets the upper teeth, the tongue is made thinner. It also moves sideways with the lower lip.
"""

# mypy: disable-error-code="call-arg"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.jit import kernel, nonallocating
from surface.dcp import DCPSurface
from surface.head.model.data import HeadData, PartData
from surface.head.model.meshes import domain_of, make_surface
from surface.head.model.parameters import SHAPES, Pose, smoothstep
from surface.head.posing.contact import weights_at

TONGUE = SHAPES.index("tongueOut")
GRID = 56  # samples of the tongue and of the teeth along u and v, out of which stations are chosen
STATIONS, LENGTH_MM = 18, 55.0  # along the tongue, from its tip backwards
ACROSS = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)  # places of a station, in half widths of the tongue there
BIN_MM = 2.0  # width of the columns in which the highest samples of teeth are kept
REACH_MM = 5.0  # horizontal distance from a station beyond which a sample does not lift it
CLEAR_MM, SOFT_MM = 0.6, 0.4  # distance kept from what the tongue rests on; how much earlier the correction begins
SLICE_MM = 2.5  # half the length of a slice in which the tongue's height and width are measured
BEND_MM = 16.0  # distance along the tongue over which the lift of a station fades
SIDEWAYS = 1.1  # how far the tongue follows the lower lip to a side: with less, the other corner of the mouth cuts it
PUT_OUT = (0.02, 0.3)  # tongueOut where the correction begins and where it is complete: inside the mouth there is none
BEYOND = (0.3, 0.5)  # tongueOut over which it begins to move sideways: further in, it would cut the teeth beside it
PASSES = 3
MIN_SAMPLES, MIN_LENGTH_MM = 50, 5.0  # of a part that is a tongue, and its length


@nonallocating
def find_rise(
    under: Floats, below: Floats, reach: float, clear: float, soft: float, again: bool, rise: Floats
) -> float:  # fmt: skip
    """Fill ``rise (s,)`` with how far stations ``under (s, 3)`` have to be lifted, and return the greatest of these.

    below : (k, 3) points that the stations have to stay above, sorted by z. Those further away than ``reach``,
        measured horizontally, do not count, and nearer ones count less the further away they are.
    clear, soft : distance to keep, and how much earlier lifting begins. All lengths are mm.
    again : stations have only been lifted since the last call, so those that were not too low are left out.
    """
    most = 0.0
    for s in range(len(under)):
        if again and rise[s] == 0.0:
            continue
        rise[s] = rise_of(under[s, 0], under[s, 1] - clear, under[s, 2], below, reach, soft)
        most = max(most, rise[s])
    return most


@nonallocating
def rise_of(x: float, y: float, z: float, below: Floats, reach: float, soft: float) -> float:
    """Return how far one station at (x, y, z) has to be lifted; see :func:`find_rise`."""
    most, scale = 0.0, 1.0 / (reach * reach)
    for k in range(np.searchsorted(below[:, 2], z - reach), len(below)):
        if below[k, 2] >= z + reach:
            break
        need = below[k, 1] - y
        if need + soft <= most:  # a point lifts by no more than that
            continue
        square = ((x - below[k, 0]) ** 2 + (z - below[k, 2]) ** 2) * scale
        if square < 1.0:
            near = min(need + soft, 2.0 * soft)
            need = need if need > soft else near * near / (4.0 * soft)
            most = max(most, need * (1.0 - square) ** 2)
    return most


@nonallocating
def lift_sections(rise: Floats, fade: Floats, part: Floats, share: float, lift: Floats, points: Floats) -> None:
    """Move control points (n, 3) up by the rise of the cross-sections near them.

    rise : (s k,) of k stations in each of s cross-sections; the greatest in each section counts.
    fade : (s, n) how much of a section's rise a point takes; the greatest of these products is its lift.
    part, share : (n,) and one factor, both 0..1, of that lift. lift : (n,) scratch space.
    """
    across = len(rise) // len(fade)
    for i in range(len(points)):
        lift[i] = 0.0
    for s in range(len(fade)):
        most = 0.0
        for k in range(s * across, (s + 1) * across):
            most = max(most, rise[k])
        if most > 0.0:
            for i in range(len(points)):
                lift[i] = max(lift[i], most * fade[s, i])
    for i in range(len(points)):
        points[i, 1] += share * part[i] * lift[i]


@nonallocating
def place_stations(start: Ints, ids: Ints, weights: Floats, sign: float, points: Floats, out: Floats) -> None:
    """Fill ``out (s, 3)`` with the places of the stations, sums of ``weights`` times control points (n, 3), as
    :func:`.contact.weights_at` lists them. ``sign`` multiplies y: -1 turns the tongue over, so that its upper side can
    be treated as its underside."""
    for s in range(len(out)):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(start[s], start[s + 1]):
            i, w = ids[k], weights[k]
            x, y, z = x + w * points[i, 0], y + w * points[i, 1], z + w * points[i, 2]
        out[s, 0], out[s, 1], out[s, 2] = x, sign * y, z


@kernel
def press(
    start: Ints, ids: Ints, weights: Floats, against: Floats, fade: Floats, part: Floats, sign: float, share: float,
    points: Floats,
) -> None:  # fmt: skip
    """Move control points (n, 3) of the tongue until its stations clear the points ``against (k, 3)``.

    start, ids, weights, sign : as in :func:`place_stations`. against : sorted by z, y multiplied by ``sign``.
    fade, part, share : as in :func:`lift_sections`.
    """
    stations, rise, lift = np.zeros((len(start) - 1, 3)), np.zeros(len(start) - 1), np.zeros(len(points))
    for again in range(PASSES):
        place_stations(start, ids, weights, sign, points, stations)
        if find_rise(stations, against, REACH_MM, CLEAR_MM, SOFT_MM, again > 0, rise) < SOFT_MM / 4.0:
            break
        lift_sections(rise, fade, part, sign * share, lift, points)


@nonallocating
def sort_by_depth(at: Floats, order: Ints, out: Floats) -> None:
    """Copy points ``at (k, 3)`` to ``out (k, 3)`` sorted by z; ``order (k,)`` becomes the row that each comes from.

    The search starts from the order of the last call, which is nearly right from one frame of a motion to the next.
    """
    for k in range(1, len(order)):
        i, j = order[k], k
        while j > 0 and at[order[j - 1], 2] > at[i, 2]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = i
    for k in range(len(order)):
        for c in range(3):
            out[k, c] = at[order[k], c]


@nonallocating
def go_aside(lip: Floats, sideways: Floats, share: float, points: Floats) -> None:
    """Move control points (n, 3) of the tongue along x towards the middle of the lower lip.

    lip : (k, 3) its samples. sideways : (n,) 0..1, how much each point takes part, both in the mean of the tongue and
    in the move. share : of the distance between both means.
    """
    middle, own, total = 0.0, 0.0, 0.0
    for k in range(len(lip)):
        middle += lip[k, 0]
    for i in range(len(points)):
        own += sideways[i] * points[i, 0]
        total += sideways[i]
    aside = share * (middle / len(lip) - own / total)
    for i in range(len(points)):
        points[i, 0] += aside * sideways[i]


@nonallocating
def gather_below(lip: Floats, lower: Floats, linear: Floats, shift: Floats, out: Floats) -> None:
    """Fill ``out (k + m, 3)`` with samples of the ``lip (k, 3)`` and of the ``lower (m, 3)`` teeth; the teeth are moved
    with the jaw by ``linear (3, 3)`` and ``shift (3,)``."""
    for k in range(len(lip)):
        for c in range(3):
            out[k, c] = lip[k, c]
    for k in range(len(lower)):
        for c in range(3):
            moved = shift[c]
            for d in range(3):
                moved += linear[c, d] * lower[k, d]
            out[len(lip) + k, c] = moved


@kernel
def rest_tongue(  # type: ignore[no-untyped-def]
    underside, upper_side, lip, lower, upper, linear, shift, fade, sideways, thick, share, aside, order, points
):  # fmt: skip
    """All steps of :meth:`TongueRest.apply` in one compiled call.

    underside, upper_side : the stations of either side, as the first three parameters of :func:`press`.
    aside : ``share`` of :func:`go_aside`. thick : (n,) 0 at the underside, 1 at the upper side.
    """
    go_aside(lip, sideways, aside, points)
    at, below = np.empty((len(order), 3)), np.empty((len(order), 3))
    gather_below(lip, lower, linear, shift, at)
    sort_by_depth(at, order, below)
    start, ids, weights = underside
    press(start, ids, weights, below, fade, np.ones(len(points)), 1.0, share, points)
    start, ids, weights = upper_side
    press(start, ids, weights, upper, fade, thick, -1.0, share, points)


def tongue_rest(part: PartData, head: HeadData) -> TongueRest | None:
    """Return the correction of a tongue; None for a part without a surface, or too short to have a direction."""
    surface = make_surface(part)
    places, at = _samples(part, surface)
    if len(at) < MIN_SAMPLES or np.ptp(at[:, 2]) <= MIN_LENGTH_MM:
        return None
    return TongueRest(part, head, surface, places, at)


class TongueRest:
    """Keeps a part with the group tongueOut above the lower lip and the lower teeth, and below the upper teeth.

    part, surface : the tongue. head : has the teeth. places : (k, 2) samples all over the tongue, in (u, v).
    at : (k, 3) the positions of these samples, mm.
    """

    def __init__(self, part: PartData, head: HeadData, surface: DCPSurface, places: Floats, at: Floats) -> None:
        z = part.points[:, 2]
        length = min(LENGTH_MM, 0.8 * float(np.ptp(at[:, 2])))
        along = at[:, 2].max() - np.linspace(1.0, length, STATIONS)
        self._sides = [weights_at(surface, _stations(places, at, along, sign)) for sign in (-1.0, 1.0)]
        away = np.abs(z[None] - along[:, None])
        away[0, z > along[0]] = 0.0  # the tip moves with the first station
        self._fade = 1.0 - smoothstep(away / BEND_MM)
        self._sideways = smoothstep(z, along[0] - 0.7 * length, along[0])
        low, high = _thickness(at, z)
        self._thick = np.clip((part.points[:, 1] - low) / np.maximum(high - low, 1e-6), 0.0, 1.0)
        self._lower, upper = (_edges(head, follows, sign) for follows, sign in (("jaw", 1.0), ("skull", -1.0)))
        self._upper = _sort_by_depth(upper, -1.0)
        self._order = np.zeros(0, np.int64)  # of what lies below the tongue, by depth

    def share(self, pose: Pose) -> float:
        """Return how much of the correction a pose takes, 0..1: none while the tongue is in the mouth."""
        return _ease(float(pose.shapes[TONGUE]), *PUT_OUT)

    def apply(self, pose: Pose, lip: Floats, linear: Floats, shift: Floats, points: Floats) -> None:
        """Move control points (n, 3) in place; ``lip (k, 3)`` are samples of the lower lip, and the lower teeth are
        moved by ``linear (3, 3)`` and ``shift (3,)``."""
        share = self.share(pose)
        if share <= 0.0 or not len(lip):
            return
        below = len(lip) + len(self._lower)
        if len(self._order) != below:
            self._order = np.arange(below)
        aside = SIDEWAYS * _ease(float(pose.shapes[TONGUE]), *BEYOND)
        rest_tongue(*self._sides, lip, self._lower, self._upper, linear, shift, self._fade, self._sideways, self._thick,
                    share, aside, self._order, points)  # fmt: skip


def _ease(x: float, low: float, high: float) -> float:
    """Return 0 up to ``low``, 1 from ``high`` on, and smooth between."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def _sort_by_depth(at: Floats, sign: float) -> Floats:
    """Return points (k, 3) sorted by z, with y times ``sign``."""
    rising: Floats = at[np.argsort(at[:, 2])] * (1.0, sign, 1.0)
    return rising


def _grid(part: PartData) -> Floats:
    """Return (k, 2): places all over a part, in (u, v)."""
    domain = domain_of(part)
    u0, u1, v0, v1 = domain.rect
    grid = np.stack(np.meshgrid(np.linspace(u0, u1, GRID), np.linspace(v0, v1, GRID)), axis=-1).reshape(-1, 2)
    inside: Floats = grid[domain.inside(grid)]
    return inside


def _samples(part: PartData, surface: DCPSurface) -> tuple[Floats, Floats]:
    """Return (k, 2): places all over a part, in (u, v), and their positions (k, 3), mm; only where control points cover
    it."""
    places = _grid(part)
    at = surface.evaluate(places)
    covered = np.isfinite(at).all(axis=1)
    return places[covered], at[covered]


def _slice(at: Floats, z: float) -> Bools:
    """Return (k,): whether each sample lies in the slice at z; the nearest one always does."""
    away = np.abs(at[:, 2] - z)
    return away <= max(SLICE_MM, float(away.min()))


def _stations(places: Floats, at: Floats, along: Floats, sign: float) -> Floats:
    """Return (STATIONS * len(ACROSS), 2): stations in (u, v) on the tongue's upper side (``sign`` 1) or underside (-1),
    at each z of ``along``, chosen from samples ``places (k, 2)`` with positions ``at (k, 3)``."""
    out = []
    for z in along:
        here = at[_slice(at, z)]
        half, middle = np.abs(here[:, 0]).max(), 0.5 * (here[:, 1].min() + here[:, 1].max())
        own = np.flatnonzero(sign * (at[:, 1] - middle) >= 0.0)
        for x in ACROSS:
            away = (at[own, 0] - x * half) ** 2 + (at[own, 2] - z) ** 2
            out.append(places[own[away.argmin()]])
    return np.array(out)


def _thickness(at: Floats, z: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and highest y (n,) of the tongue, of which ``at (m, 3)`` are samples, at each of ``z (n,)``."""
    knots = np.linspace(at[:, 2].min(), max(at[:, 2].max() - SLICE_MM, at[:, 2].min()), 30)
    slices = [at[_slice(at, k), 1] for k in knots]
    return np.interp(z, knots, [s.min() for s in slices]), np.interp(z, knots, [s.max() for s in slices])


def _edges(head: HeadData, follows: str, sign: float) -> Floats:
    """Return (k, 3): the highest (1) or lowest (-1) sample of teeth at jaw or skull in each cell of BIN_MM, seen from
    above."""
    teeth = [p for p in head.parts if p.follows == follows and p.material == "teeth"]
    return np.concatenate([np.zeros((0, 3)), *(_edge(p, sign) for p in teeth)])


def _edge(part: PartData, sign: float) -> Floats:
    at = _samples(part, make_surface(part))[1]
    cell = np.floor(at[:, [0, 2]] / BIN_MM).astype(np.int64)
    order = np.lexsort((sign * at[:, 1], cell[:, 1], cell[:, 0]))
    last = np.append((np.diff(cell[order], axis=0) != 0).any(axis=1), True)
    return np.ascontiguousarray(at[order[last]])
