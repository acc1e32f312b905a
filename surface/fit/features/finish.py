"""Finish a fitted head: add wrinkles, contacts of lips and lids, and corrective shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from surface.base import files
from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.fit.features.rigging import (
    BACK,
    BACK_RULE,
    DROOP,
    DROOP_RULE,
    LOW,
    LOW_RULE,
    drawn_back_tongue,
    lowered_tongue,
)
from surface.fit.features.wrinkles import add_wrinkles
from surface.fit.points.recipe import Recipe
from surface.fit.points.strokes import arc_length
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.frame import head_scale
from surface.head.model.data import Contact, Group, HeadData, PartData, Rule, Seal
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import NAMES as PARAMETERS
from surface.head.model.parameters import SHAPES, read_pose
from surface.head.posing.contact import FORWARD, ContactSolver
from surface.head.posing.rig import SkinRig

LIPS = Path(__file__).with_name("lips.toml")  # what parts the lips of a fitted head
PARTED_MM = 4.0  # on a usual head: lips that a shape of a mesh parts further than that are to be open
PARTED = 1.4  # share of such a shape in what opens lips, that of mouthFunnel
CLOSES = "mouthClose"  # takes back what the jaw opens, and parts nothing
SETTLINGS = 4  # each halves what contacts still move at rest
PRODUCT = "*"  # between the two shapes in the name of a corrective's group
COLUMNS, ROWS, FADE_ROWS = 21, 10, 5
FINE_U, FINE_V = 61, 49  # grid that columns are interpolated in, along and across an opening
NAMES = ("left_lids", "right_lids", "lips")
LID_LINING, LIP_LINING = ("lashes", "sockets"), ("cavity",)
MARGIN_U, WIDEST_V = 0.5, 0.25  # how far outside the opening (in its widths) and from its rim (in v) samples may be
INSET = 0.03  # of the opening's width: place of its first column


def finish_head(head: HeadData, mesh: FitMesh, charts: dict[str, Chart], recipe: Recipe) -> HeadData:
    """The head with wrinkles, contacts and correctives; its points at rest are those that contacts leave unchanged."""
    face = next((p for p in head.parts if p.follows == "skin" and len(p.slits) and p.name in charts), None)
    if face is None:
        return head
    rules = [DROOP_RULE] if any(g.name == DROOP for p in head.parts for g in p.groups) else []
    wrinkled, folds = add_wrinkles(face, charts[face.name], mesh, recipe.wrinkles)
    names = tuple(p.name for p in head.parts)
    contacts = find_contacts(wrinkled, head.eyes, head.eye_radius, names, cling=bool(recipe.parts))
    parts = [wrinkled if p is face else p for p in head.parts]
    head = replace(head, parts=parts, rules=[*rules, *folds], contacts=contacts)
    if not recipe.parts:
        head = part_lips(head, head_scale(mesh.vertices, dict(zip(mesh.names, mesh.deltas, strict=True))))
    head = lower_tongue(head, recipe)
    head = add_correctives(head, recipe.correctives)
    head = draw_back_tongue(head, recipe)  # after the correctives: of a lip's roll, the lip alone has some
    rest = read_pose(np.zeros(59))
    for _ in range(SETTLINGS):
        points = [SkinRig(p, head).apply(rest).copy() if p.follows == "skin" else p.points for p in head.parts]
        head = replace(head, parts=[replace(p, points=at) for p, at in zip(head.parts, points, strict=True)])
    return head


def part_lips(head: HeadData, scale: float) -> HeadData:
    """The head whose lips may part in shapes that open them by more than :data:`PARTED_MM`: so the mesh's maker wanted
    it, as in the round open mouth that drawn characters make of mouthPucker.

    scale : size of the head relative to a usual one.
    """
    contacts = []
    for contact in head.contacts:
        seal = contact.seal
        if seal is not None:
            wide = [n for n, gap in lip_gaps(head, contact).items() if gap > PARTED_MM * scale]
            opens = {n: PARTED for n in wide if seal.opens.get(n, 0.0) <= 0.0 and n != CLOSES}
            contact = replace(contact, seal=replace(seal, opens={**seal.opens, **opens}))
        contacts.append(contact)
    return replace(head, contacts=contacts)


def lip_gaps(head: HeadData, contact: Contact) -> dict[str, float]:
    """By shape at 1, how much further than at rest the lips of a contact stand open where nothing keeps them together,
    mm."""
    part = next(p for p in head.parts if p.name == contact.part)
    rig = SkinRig(part, replace(head, contacts=[]))
    solver = ContactSolver(replace(contact, seal=None), make_surface(part), head)

    def widest(name: str) -> float:
        solver.apply(FORWARD, rig.apply(read_pose(np.array([float(n == name) for n in PARAMETERS]))).copy())
        return float(solver.gaps().max())

    rest = max(widest(""), 0.0)
    return {g.name: widest(g.name) - rest for g in part.groups if g.name in SHAPES}


def lower_tongue(head: HeadData, recipe: Recipe) -> HeadData:
    """The head whose tongue sinks as the jaw opens, where the recipe says how far."""
    if not recipe.tongue_low or not any(part.material == "tongue" for part in head.parts):
        return head
    head = _with_tongue_group(head, lambda at: lowered_tongue(at, np.array(recipe.tongue), recipe.tongue_low))
    return replace(head, rules=[*head.rules, LOW_RULE])


def draw_back_tongue(head: HeadData, recipe: Recipe) -> HeadData:
    """The head whose tongue draws back from a lower lip that rolls in, where the recipe says how far."""
    if not recipe.tongue_back or not any(part.material == "tongue" for part in head.parts):
        return head
    head = _with_tongue_group(head, lambda at: drawn_back_tongue(at, np.array(recipe.tongue), recipe.tongue_back))
    return replace(head, rules=[*head.rules, BACK_RULE])


def _with_tongue_group(head: HeadData, made: Callable[[Floats], Group]) -> HeadData:
    parts = [
        replace(part, groups=[*part.groups, made(part.points)]) if part.material == "tongue" else part
        for part in head.parts
    ]
    return replace(head, parts=parts)


def add_correctives(head: HeadData, wanted: list[dict[str, Any]]) -> HeadData:
    """The head with corrective shapes: groups for pairs of shapes that do not add up, worth the product of the two.

    wanted : tables with ``shapes``, two of them; ``subtract``, shares of displacements of shapes that are taken back
        where both are whole; ``gain``, by which each is multiplied before that, and then goes to 1 at most; ``unless``,
        a shape that is taken from each of the two first.
    """
    for table in wanted:
        first, second = table["shapes"]
        gain = float(table.get("gain", 1.0))
        less = {table["unless"]: -gain} if "unless" in table else {}
        rule = Rule(f"{first}{PRODUCT}{second}", ({first: gain} | less, {second: gain} | less))
        parts = [_corrected(p, rule.group, table["subtract"]) for p in head.parts]
        head = replace(head, parts=parts, rules=[*head.rules, rule])
    return head


def _corrected(part: PartData, name: str, shares: dict[str, float]) -> PartData:
    """The part with a group that takes back shares of others, if that moves anything."""
    field = np.zeros((len(part.points), 3), np.float32)
    for g in part.groups:
        field[g.ids] -= np.float32(shares.get(g.name, 0.0)) * g.moves
    ids = np.flatnonzero(np.abs(field).max(axis=1) > 1e-3).astype(np.int32)
    return replace(part, groups=[*part.groups, Group(name, ids, field[ids])]) if len(ids) else part


def is_on_purpose(rule: Rule) -> bool:
    """Whether a rule changes shapes of the mesh on purpose: a corrective, or what the tongue gives way to."""
    return PRODUCT in rule.group or rule.group in (LOW, BACK)


def find_contacts(
    face: PartData, eyes: Floats, radius: float, parts: tuple[str, ...], *, cling: bool = True
) -> list[Contact]:  # fmt: skip
    """Contacts at the holes of a face that are cut by slits: lids where an eyeball is behind, else lips.

    face : the part with the holes. eyes : (2, 3) centres; radius : 0 for a head without known eyes.
    parts : names of all parts; those that line an opening or are rooted at it are its followers.
    cling : do lids follow the eyeball as closely in every shape as at rest? Those of a mesh without a recipe are
        coarser than its cornea, which would show in them as a bump.
    """
    surface = make_surface(face)
    out = []
    for loop in face.loops[1:]:
        if not any(loop[:, 0].min() - 1e-9 <= s and e <= loop[:, 0].max() + 1e-9 for _, s, e in face.slits):
            continue
        middle = surface.evaluate(loop).mean(axis=0)
        near = [float(np.linalg.norm(middle - eye)) for eye in eyes] if radius > 0 else []
        lids = bool(near) and min(near) < 1.5 * radius
        eye = int(np.argmin(near)) if lids else -1
        lining = [p for p in (LID_LINING if lids else LIP_LINING) if p in parts]
        depth, reach, share = (0.58 * radius, 0.5 * radius, 0.8) if lids else (15.0, 12.0, 0.5)
        places = sample_places(surface, loop, depth, reach)
        seal = None if lids else Seal(**files.read_toml(LIPS))
        out.append(Contact(NAMES[eye], face.name, tuple(lining), eye, reach, share, places, cling, seal))
    return out


def sample_places(surface: DCPSurface, loop: Floats, depth_mm: float, reach_mm: float) -> Floats:
    """(2, COLUMNS, ROWS + FADE_ROWS, 2) in (u, v): from a hole's rim outwards at constant x, upper side first.

    Rows go ``depth_mm`` along the skin, as far as the sides can meet, and FADE_ROWS further over ``reach_mm``.
    """
    rim = surface.evaluate(loop)
    low, high = rim[:, 0].min(), rim[:, 0].max()
    columns = np.linspace(low + INSET * (high - low), high - INSET * (high - low), COLUMNS)
    fade = depth_mm + reach_mm * np.linspace(0.0, 1.0, FADE_ROWS + 1)[1:]
    wanted = np.concatenate([np.linspace(0.0, depth_mm, ROWS), fade])
    middle = 0.5 * (loop[:, 1].min() + loop[:, 1].max())
    sides = []
    for sign in (1.0, -1.0):
        half = (loop[:, 1] - middle) * sign >= 0
        order = np.argsort(rim[half, 0])
        start = np.column_stack([np.interp(columns, rim[half, 0][order], loop[half, i][order]) for i in (0, 1)])
        sides.append(_along(surface, loop, start, columns, sign, wanted))
    return np.stack(sides)


def _along(surface: DCPSurface, loop: Floats, start: Floats, x: Floats, sign: float, wanted: Floats) -> Floats:
    """(COLUMNS, rows, 2) places ``wanted (rows,)`` mm along the skin from ``start (COLUMNS, 2)``, at constant x."""
    width = np.ptp(loop[:, 0])
    u = np.linspace(loop[:, 0].min() - MARGIN_U * width, loop[:, 0].max() + MARGIN_U * width, FINE_U)
    middle = 0.5 * (loop[:, 1].min() + loop[:, 1].max())
    v = middle + sign * np.linspace(1e-4, WIDEST_V, FINE_V)
    at = surface.evaluate(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)).reshape(FINE_V, FINE_U, 3)
    out = np.empty((len(x), len(wanted), 2))
    for k, place in enumerate(start):
        beyond = (v - place[1]) * sign > 1e-3
        trace = np.column_stack([[np.interp(x[k], np.maximum.accumulate(r[:, 0]), u) for r in at[beyond]], v[beyond]])
        trace = np.concatenate([place[None], trace])
        length = arc_length(surface.evaluate(trace))
        out[k] = np.column_stack([np.interp(wanted, length, trace[:, i]) for i in (0, 1)])
    return out
