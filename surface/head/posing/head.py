"""Load and pose a head: vertices and normals of all its parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import HeadFileError
from surface.head.model.accessories import read_accessories
from surface.head.model.data import Contact, Group, HeadData, PartData
from surface.head.model.file import load_data
from surface.head.model.finer_mesh import FinerMesh
from surface.head.model.identity import load_identities, with_identities
from surface.head.model.light import LightPoints, with_light
from surface.head.model.look import Look, with_age, with_forehead
from surface.head.model.meshes import make_surface, tessellate, unpack
from surface.head.model.own_groups import OwnAmounts, OwnGroup, OwnMoves
from surface.head.model.parameters import NAMES, SHAPES, Pose, read_pose, rotation
from surface.head.model.rounding import with_rounder_outlines
from surface.head.model.rules import Drivers
from surface.head.model.sidecar import DAMAGED, reason
from surface.head.model.sway import STEP_MM, WIDEST, Sway
from surface.head.model.texture import HeadTexture, read_texture
from surface.head.model.wardrobe import carried, read_garment, with_garments
from surface.head.posing.appearance import apply_look, apply_texture
from surface.head.posing.dressing import WornMesh, dress
from surface.head.posing.finer import apply_baked, coarser_of
from surface.head.posing.paint import paint_part
from surface.head.posing.part import HeadPart, RigidPart, SkinPart, Turn
from surface.head.posing.seams import SeamStitch

RIGID = ("skull", "jaw", "left_eye", "right_eye")


class Head:
    """A face made of DCP surfaces that follows parameters.

    Use :meth:`load`. One object belongs to one thread at a time.

    data : everything a head file holds; where : its path, for messages.
    sway : of its hair; a program that draws a moving picture gives it the time.
    rise_mm, pupil : what :meth:`live` set.
    own_groups : what :meth:`add_groups` added.
    accessories : meshes that it wears as they are, such as glasses; no parts, because no control points move them.
    texture : of its skin and eyes, as its mesh brought it; None without one.
    """

    parameters: tuple[str, ...] = NAMES

    def __init__(self, data: HeadData, where: str = "head") -> None:
        self.data = data
        drivers = Drivers(data.rules, where)
        self.parts: tuple[HeadPart, ...] = tuple(_make_part(p, data, drivers, where) for p in data.parts)
        by_name = {p.name: p for p in self.parts}
        self._stitches = tuple(SeamStitch(s, by_name[s.part_a], by_name[s.part_b]) for s in data.seams)
        for stitch in self._stitches:
            stitch.close()
        self.sway = Sway()
        self.rise_mm = self.pupil = 0.0
        self._own, self.own_groups = OwnAmounts(()), tuple[OwnGroup, ...]()
        self._at = {name: i for i, name in enumerate(self.parameters)}
        self._last_turn = b"", Turn(np.eye(3), data.neck.pivot)
        self.accessories: tuple[WornMesh, ...] = ()
        self.texture: HeadTexture | None = None

    @property
    def contacts(self) -> Sequence[Contact]:
        """Of lids and lips."""
        return self.data.contacts

    @classmethod
    def load(
        cls, path: str | Path, identity: Mapping[str, float] | None = None, look: Look | None = None,
        light: Sequence[LightPoints] = (), chord_mm: float | None = None,
    ) -> Head:  # fmt: skip
        """Read a head from its folder or its head.toml.

        identity : variations of the head to mix in, by name, each by 0 to 1.
        look : colours of a person, and what is worn; the head's own where it is None.
        light : control points to add behind those of each part, see :mod:`surface.head.model.light`.
        chord_mm : how far edges of skin and clothes may lie from their surface, mm, where the stored ones may lie
        farther: for large pictures, whose outlines would show them; every pose takes longer.

        Raises HeadFileError: a file is missing, damaged, cut short, of another version or made for another mesh (names
        file and key), or the head has no identity of that name. ValueError: control points that cannot be added.
        """
        data = _with_person(load_data(path), path, identity, look)
        _check_tilts(data, path)
        garments = tuple(read_garment(worn) for worn in look.worn) if look is not None else ()
        if garments:
            data = with_garments(data, garments, str(path))
        refined: Mapping[str, FinerMesh] = {}
        if light:
            data, refined = with_light(data, light, partial(coarser_of, path))
        if chord_mm is not None:
            data, refined = with_rounder_outlines(data, chord_mm, refined, partial(coarser_of, path))
            garments = tuple(carried(garment, refined) for garment in garments)
        accessories, texture = read_accessories(path), read_texture(path)
        try:
            head = cls(data, str(path))
            head.accessories = tuple(WornMesh(one, data.neck) for one in accessories)
            apply_baked(path, head.parts, refined)
            if texture is not None:
                head.texture = texture
                apply_texture(head.parts, texture)
            if look is not None:
                apply_look(head.parts, look, data.eyes)
                dress(head.parts, garments)
        except DAMAGED as error:
            hint = "take it from a copy, or make the head again: omote fit"
            raise HeadFileError(f"{path}: its files are damaged: {reason(error)}", hint=hint) from error
        return head

    @property
    def name(self) -> str:
        """The head's short name."""
        return self.data.name

    def part(self, name: str) -> HeadPart:
        """Return the part of that name; KeyError if there is none."""
        for p in self.parts:
            if p.name == name:
                return p
        raise KeyError(f"no part {name!r}; there are {', '.join(p.name for p in self.parts)}")

    @property
    def stitches(self) -> tuple[SeamStitch, ...]:
        """The head's seams, in the order in which they are closed."""
        return self._stitches

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of all groups, in the order of the parameters."""
        found = {g.name for p in self.data.parts for g in p.groups}
        return tuple(n for n in self.parameters if n in found)

    def group(self, name: str) -> dict[str, Group]:
        """Return the group of that name: part name -> control points and their displacements per unit.

        Raises KeyError: no group of that name.
        """
        found = {p.name: g for p in self.data.parts for g in p.groups if g.name == name}
        if not found:
            raise KeyError(f"no group {name!r}; there are {', '.join(self.groups)}")
        return found

    def add_groups(self, groups: Sequence[OwnGroup]) -> None:
        """Let parameters of a user's own, which follow the others in :attr:`parameters`, move control points.

        Whoever draws the head begins afterwards; groups that were added before are replaced.

        Raises ValueError: a group names no parameter. KeyError: no such part, or one that is rigid.
        """
        amounts = OwnAmounts(groups)
        rigs = {part.name: part.rig for part in self.parts if isinstance(part, SkinPart)}
        own: dict[str, list[OwnMoves]] = {name: [] for name in rigs}
        for i, group in enumerate(groups):
            own[group.part].append(OwnMoves(i, group.ids, group.moves))
        for name, rig in rigs.items():
            rig.own = own[name]
            rig.invalidate()
        self._own, self.parameters, self.own_groups = amounts, amounts.names, tuple(groups)
        self._at = {name: i for i, name in enumerate(self.parameters)}

    def values(self, given: Mapping[str, float]) -> Floats:
        """Return a parameter vector (P,) from names and values, 0 elsewhere; KeyError for an unknown name."""
        out = np.zeros(len(self.parameters))
        for name, value in given.items():
            out[self._at[name]] = value
        return out

    def pose(self, values: Floats) -> None:
        """Move all parts to parameter values (P,) in the order of :attr:`parameters`; values are clipped.

        Raises ValueError: wrong shape or a value that is not a number; the head keeps its pose.
        """
        pose = self.read_pose(values)
        turn = self._make_turn(pose.head)
        for part in self.parts:
            part.pose(pose, turn)
        for stitch in self._stitches:
            stitch.close()

    def live(self, rise_mm: float, pupil: float, adapted: float = 1.0) -> None:
        """Breathe and change the pupils in pictures from now on, beside the parameters.

        rise_mm : by which a breath lifts the chest. pupil : share by which both pupils are wider than the light makes
        them, within :data:`surface.head.model.sway.WIDEST`; 0 for both is rest. adapted : how wide the light makes them
        now, of how wide it makes them in the end, above 0; other than 1 while they adapt to another light.
        """
        self.rise_mm = round(rise_mm / STEP_MM) * STEP_MM
        own = min(max(pupil, -WIDEST), WIDEST)
        self.pupil = own + (adapted - 1.0) * (1.0 + own)

    def read_pose(self, values: Floats) -> Pose:
        """Return parameter values (P,) as a pose, with what sways and the breath where they are now; errors as
        :meth:`pose`."""
        given = np.asarray(values, float)
        if given.shape != (len(self.parameters),):
            raise ValueError(f"values has shape {given.shape}, expected ({len(self.parameters)},)")
        pose = read_pose(given[: len(NAMES)])
        pose.own = self._own(given)
        pose.lag, pose.rise_mm = self.sway.lag, self.rise_mm
        return pose

    def own_amounts(self, values: Floats) -> Floats:
        """Return (g,): how much of each of :attr:`own_groups` parameter values (P,) show, -1 to 1; errors as
        :meth:`pose`."""
        return self._own(np.asarray(values, float))

    def place_points(self, values: Floats) -> tuple[list[Floats], Turn]:
        """Do the same as :meth:`pose`, but only the points that vertices are summed from; vertices and normals stay.

        Returns (k, 3) float64 of every part, overwritten by the next call, and the head's rotation; see
        :class:`surface.head.posing.influence.Influence`.
        """
        return self.place_pose(self.read_pose(values), {})

    def place_pose(self, pose: Pose, moved: Mapping[str, Floats]) -> tuple[list[Floats], Turn]:
        """Do the same as :meth:`place_points` for a pose; ``moved`` : by part, what :meth:`.rig.SkinRig.move_all`
        found for it.
        """
        rows = [part.place_points(pose, moved.get(part.name)) for part in self.parts]
        return rows, self._make_turn(pose.head)

    def _make_turn(self, angles: Floats) -> Turn:
        """Return the rotation of a pose by its angles (3,); the last one, if they are the same."""
        key = angles.tobytes()
        if key != self._last_turn[0]:
            self._last_turn = key, Turn(rotation(*angles), self.data.neck.pivot)
        return self._last_turn[1]


def _with_person(
    data: HeadData, path: str | Path, identity: Mapping[str, float] | None, look: Look | None
) -> HeadData:  # fmt: skip
    """Return the data of the head at ``path`` with an identity, and the age and forehead of a look; errors as
    :meth:`Head.load`."""
    if identity:
        data = with_identities(data, load_identities(path), identity, str(path))
    return data if look is None else with_age(with_forehead(data, look.forehead), look.age)


def _check_tilts(data: HeadData, path: str | Path) -> None:
    """Raise HeadFileError where the jaw tilts by what is no shape."""
    for shape in data.jaw.tilts:
        if shape not in SHAPES:
            raise HeadFileError(f"{path}: jaw.tilts.{shape}: is no shape", hint="name a shape of the head")


def _make_part(part: PartData, head: HeadData, drivers: Drivers, where: str) -> HeadPart:
    if part.follows != "skin" and part.follows not in RIGID:
        raise HeadFileError(
            f"{where}: part {part.name!r}: follows: {part.follows!r} is not one of skin, {', '.join(RIGID)}"
        )
    try:
        surface = make_surface(part)
        kept = unpack(part.mesh, surface, part.budget, rough=part.follows == "skin", flip=part.flip)
        mesh = kept or tessellate(part, surface, head.seams)
    except ValueError as e:
        raise HeadFileError(f"{where}: part {part.name!r}: {e}", hint="make the head again: omote fit") from e
    attributes = paint_part(head.paint, part.name, mesh.uv, where)
    if part.follows in ("left_eye", "right_eye"):  # in the eye's frame, in radii, +z through the pupil
        local = (mesh.vertices - head.eyes[int(part.follows == "right_eye")]) / head.eye_radius
        attributes["eye_local"] = local.astype(np.float32)
    made: HeadPart = (
        SkinPart(part, head, mesh, surface, attributes, drivers)
        if part.follows == "skin"
        else RigidPart(part, head, mesh, surface, attributes)
    )
    made.stored = kept is not None
    return made
