"""Exporter of heads as binary glTF 2.0 (specification, sections 3 and 4): a node a part, a morph target a shape."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from surface.base.errors import ExportError
from surface.base.writing import replacing
from surface.export.animation import Animation
from surface.export.exporter import Exporter
from surface.export.frames import in_file, placement_of
from surface.export.glb_document import METRES, Document
from surface.export.glb_motion import add_motion
from surface.export.glb_web import web_glb
from surface.export.shapes import ExportPart, export_parts, is_posed
from surface.export.worn import accessory_parts
from surface.head import Head
from surface.head.model.parameters import ANGLES


def write_glb(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """See :func:`surface.export.export_head`."""
    _refuse_angles(pose)
    _replace(path, Document(head, _parts(head), pose).bytes())
    return [path]


def write_glb_in_file(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """Do the same as :func:`write_glb`, in axes, origin and unit of the file that the head was fitted to."""
    _refuse_angles(pose)
    placement = placement_of(head)
    parts = in_file(_parts(head), placement, 1.0 / float(METRES))
    _replace(path, Document(head, parts, pose, {"frame": "file", "placement": placement.table()}).bytes())
    return [path]


def write_animated_glb(head: Head, animation: Animation, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """Do the same as :func:`write_glb`, with an animation: weights of shapes over time, and a joint that turns the
    head."""
    _refuse_angles(pose)
    parts = _parts(head)
    document = Document(head, parts, pose)
    add_motion(document, head, parts, animation)
    _replace(path, document.bytes())
    return [path]


def write_web_glb(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """Do the same as :func:`write_glb`, small and for pages of browsers; see :mod:`surface.export.glb_web`."""
    if is_posed(head, pose):
        raise ExportError("a file for the web is written at rest", hint="leave out --set and --expression, or --web")
    _replace(path, web_glb(head))
    return [path]


def _parts(head: Head) -> list[ExportPart]:
    """Return the parts of a head at rest and, behind them, its accessories."""
    return export_parts(head) + accessory_parts(head)


def _refuse_angles(pose: Mapping[str, float]) -> None:
    angles = [n for n, v in pose.items() if n in ANGLES and v]
    if angles:
        raise ExportError(f"{angles[0]}: angles are no morph targets", hint="export an .obj in this pose")


def _replace(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


EXPORTER = Exporter(
    api=1,
    kind="glb",
    title="all parts, materials, and one morph target a shape",
    suffixes=(".glb",),
    write=write_glb,
    animate=write_animated_glb,
    write_in_file=write_glb_in_file,
    write_web=write_web_glb,
)
