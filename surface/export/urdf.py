"""Exporter of heads as URDF: the rigid parts of a head as links, with joints of neck, jaw and eyes, and their meshes.

Axes are those of ROS (REP 103): x forward, y left, z up, metres; joints turn about them by the right-hand rule, so that
yaw is positive to the head's own left and pitch downwards. The joints are called as the parameters, and the link
``NAME`` is what the joint of that name carries. What bends is cut: skin belongs to the link that moves it most. A URDF
has one colour for a mesh, so iris and pupil are meshes of their own; many viewers draw only the front of a triangle, so
strips of hair, which are seen from both sides, have both.
"""

from __future__ import annotations

import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.base.writing import replacing
from surface.export.exporter import Exporter
from surface.export.shapes import ExportPart, export_parts, unit
from surface.export.textures import eye_rings, materials
from surface.export.worn import accessory_parts
from surface.head import Head
from surface.head.model.joints import BASE, JAW, ROS_AXES, SKULL, Joint, JointLimit, joints_of
from surface.head.posing.part import HeadPart

_EYES = {"left_eye": "leftEyePitch", "right_eye": "rightEyePitch"}
_MIN_FRACTION = 0.5  # of a motion, from which on skin belongs to the moving link
_EFFORT_NM = 1.0
_STL_HEADER = b"written by omote; metres, x forward, y left, z up".ljust(80)
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])


_STRIPS = ("brow", "lash", "hair")
"""Materials of what is seen from both sides."""


@dataclass(frozen=True)
class Piece:
    """What a link carries: the triangles (t, 3) of a part that have one colour, RGB from 0 to 1."""

    link: str
    name: str
    part: ExportPart
    triangles: Ints
    material: str
    colour: Floats

    @property
    def file(self) -> str:
        """The name of its mesh."""
        return f"{self.link}-{self.name}.stl"

    def corners(self) -> Floats32:
        """Return the corners (t, 3, 3), mm."""
        both = [self.triangles, self.triangles[:, ::-1]] if self.part.material in _STRIPS else [self.triangles]
        found: Floats32 = self.part.vertices[np.concatenate(both)]
        return found


def write_urdf(
    head: Head, path: Path, pose: Mapping[str, float], limits: Mapping[str, JointLimit] | None = None
) -> list[Path]:
    """Write ``path`` and a folder of meshes beside it, complete or not at all; see :func:`joints_of`.

    The head is written at rest with its hair and clothes as ``pose`` leaves them; angles of ``pose`` are left out,
    because the joints turn.
    """
    joints = joints_of(head.data, limits)
    still = {name: value for name, value in pose.items() if name not in {joint.name for joint in joints}}
    pieces = _pieces(head, still)
    folder = path.with_name(f"{path.stem}_meshes")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as temporary:
        made = Path(temporary)
        folder.mkdir(exist_ok=True)
        (made / path.name).write_text(_document(head.name, joints, pieces, folder.name), encoding="utf-8")
        origins = {BASE: np.zeros(3)} | {joint.name: joint.origin for joint in joints}
        for piece in pieces:
            corners = (piece.corners() - origins[piece.link]) @ ROS_AXES.T * 1e-3
            (made / piece.file).write_bytes(_stl(corners.astype(np.float32)))
        meshes = [(made / piece.file).replace(folder / piece.file) for piece in pieces]
        with replacing(path) as beside:
            shutil.copyfile(made / path.name, beside)
        return [path, *meshes]


def _pieces(head: Head, pose: Mapping[str, float]) -> list[Piece]:
    """Return the triangles (t, 3) of each part that each link carries."""
    exported, found = export_parts(head, pose, shapes=False), list[Piece]()
    opened = [part.vertices.copy() for part in _posed(head, {**pose, JAW: 1.0})]
    for part, own, wide in zip(exported, head.parts, opened, strict=True):
        links = [BASE, SKULL, JAW, *_EYES.values()]
        carrier = _carriers(head, own, part.vertices, wide)
        of_triangle = np.sort(carrier[part.triangles], axis=1)[:, 1]  # as two of its corners or the middle one
        for number in np.unique(of_triangle).tolist():
            found += _split_by_colour(links[number], part, part.triangles[of_triangle == number])
    head.pose(head.values({}))
    return found + _worn(head)


def _worn(head: Head) -> list[Piece]:
    """Return a piece of each accessory, in the colour of its kind. The skull carries all of it, of long hair, too: cut
    where it hangs over the neck, it would tear there."""
    colours = {name: np.asarray(table["colour"], float) for name, table in materials().items() if "colour" in table}
    return [
        Piece(
            SKULL, f"{part.material}_{k}", part, part.triangles.astype(np.int64), part.material, colours[part.material]
        )
        for k, part in enumerate(accessory_parts(head), 1)
    ]


def _split_by_colour(link: str, part: ExportPart, triangles: Ints) -> list[Piece]:
    """Return a piece of each colour: one, but for an eyeball."""
    if part.material != "eye":
        colour = np.asarray(materials().get(part.material, materials()["skin"])["colour"], float)
        return [Piece(link, part.name, part, triangles, part.material, colour)]
    found, distance = [], _off_axis(part, triangles)
    for name, low, high, colour in eye_rings(part):
        inside = (distance >= low) & (distance < high)
        if inside.any():
            own = part.name if name == "sclera" else f"{part.name}_{name}"
            found.append(Piece(link, own, part, triangles[inside], f"{part.name}_{name}", colour))
    return found


def _off_axis(part: ExportPart, triangles: Ints) -> Floats:
    """Return (t,): how far the middles of triangles of an eyeball are from its axis, in its radii; 2 on its back."""
    away = part.vertices[triangles].astype(float).mean(axis=1) - part.pivot
    distance: Floats = np.hypot(away[:, 0], away[:, 1]) / np.linalg.norm(away, axis=1)
    return np.where(away[:, 2] > 0.0, distance, 2.0)


def _posed(head: Head, pose: Mapping[str, float]) -> tuple[HeadPart, ...]:
    head.pose(head.values(dict(pose)))
    return tuple(head.parts)


def _carriers(head: Head, part: HeadPart, rest: Floats32, opened: Floats32) -> Ints:
    """Return (m,): the link of each vertex: 0 the base, 1 the skull, 2 the jaw, 3 and 4 the eyes."""
    if part.follows in _EYES:
        return np.full(len(rest), 3 + list(_EYES).index(part.follows))
    if part.follows in ("jaw", "skull"):
        return np.full(len(rest), 2 if part.follows == "jaw" else 1)
    whole = _jaw_swing(head, rest)
    share = (np.asarray(opened - rest, float) * whole).sum(axis=1) / np.maximum((whole * whole).sum(axis=1), 1e-9)
    still = head.data.neck.share(rest.astype(float)) < _MIN_FRACTION
    return np.where(still, 0, np.where(share > _MIN_FRACTION, 2, 1))


def _jaw_swing(head: Head, points: Floats32) -> Floats:
    """Return (m, 3): how far the whole motion of the jaw moves points that are fixed to it, mm."""
    jaw = head.data.jaw
    sine, cosine = np.sin(jaw.angle_rad), np.cos(jaw.angle_rad)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    away: Floats = points - np.array(jaw.centre)
    moved: Floats = away @ turn.T - away + np.array(jaw.glide)
    return moved


def _document(name: str, joints: list[Joint], pieces: list[Piece], folder: str) -> str:
    robot = ET.Element("robot", name=name)
    for material, colour in {piece.material: piece.colour for piece in pieces}.items():
        rgba = " ".join(f"{c ** (1 / 2.2):.4f}" for c in colour) + " 1"
        ET.SubElement(ET.SubElement(robot, "material", name=material), "color", rgba=rgba)
    for link in (BASE, *(joint.name for joint in joints)):
        element = ET.SubElement(robot, "link", name=link)
        for piece in pieces:
            if piece.link == link:
                _add_mesh(element, f"{folder}/{piece.file}", piece.material)
    origins = {BASE: np.zeros(3)} | {joint.name: joint.origin for joint in joints}
    for joint in joints:
        _add_joint(robot, joint, origins[joint.parent])
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _add_mesh(link: ET.Element, file: str, material: str) -> None:
    visual = ET.SubElement(link, "visual")
    ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=file)
    ET.SubElement(visual, "material", name=material)


def _add_joint(robot: ET.Element, joint: Joint, parent: Floats) -> None:
    element = ET.SubElement(robot, "joint", name=joint.name, type="revolute")
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.name)
    x, y, z = ROS_AXES @ (joint.origin - parent) * 1e-3
    ET.SubElement(element, "origin", xyz=f"{x:.6f} {y:.6f} {z:.6f}", rpy="0 0 0")
    ET.SubElement(element, "axis", xyz=" ".join(map(str, joint.axis)))
    limit = joint.limit
    ET.SubElement(
        element, "limit", lower=f"{limit.low_rad:.6f}", upper=f"{limit.high_rad:.6f}",
        velocity=f"{limit.speed_rad_s:.4f}", effort=f"{_EFFORT_NM:g}",
    )  # fmt: skip


def _stl(corners: Floats32) -> bytes:
    """Return triangles (t, 3, 3) as a binary STL."""
    facets = np.zeros(len(corners), _FACET)
    facets["corners"] = corners
    facets["normal"] = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return _STL_HEADER + np.uint32(len(corners)).tobytes() + facets.tobytes()


EXPORTER = Exporter(
    api=1,
    kind="urdf",
    title="the rigid parts of the head as links with joints of neck, jaw and eyes, for robot programs; metres",
    suffixes=(".urdf",),
    write=write_urdf,
)
