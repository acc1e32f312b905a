"""What a file's format says about unit and axes of its coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surface.readers.gltf.container import Gltf
from surface.readers.meshdata import read_bytes

WRITTEN = "written by omote"  # in the first line of OBJ files that omote exports
OMOTE_OBJ = f"{WRITTEN}; millimetres, y up, z forward"  # in that of those in the head's own frame


@dataclass(frozen=True)
class Convention:
    """Unit and axes by definition; ``by`` : of what, in words. Empty: nothing is defined."""

    by: str = ""
    unit: str = ""
    up: str = ""
    forward: str = ""


GLTF = Convention("glTF", "m", "y", "z")  # glTF 2.0 specification, section 3.4
VRM0 = Convention("VRM 0", "m", "y", "-z")  # VRM 0.x: the model looks along -z; VRM 1.0: along +z, as in glTF
OBJ = Convention("omote's OBJ", "mm", "y", "z")


def convention_of(path: Path) -> Convention:
    """The convention of a mesh file. Raises FitError: a glTF file is damaged."""
    kind = path.suffix.lower()
    if kind in (".glb", ".gltf", ".vrm"):
        return _gltf(path)
    if kind == ".obj" and path.is_file() and OMOTE_OBJ in first_line(path):
        return OBJ
    return Convention()


def is_export(path: Path) -> bool:
    """Whether omote exported a mesh file. Raises FitError: a glTF file is damaged."""
    kind = path.suffix.lower()
    if kind in (".glb", ".gltf"):
        return _is_own(Gltf(path).document.get("asset"))
    return kind == ".obj" and path.is_file() and WRITTEN in first_line(path)


def _is_own(asset: Any) -> bool:
    return isinstance(asset, dict) and asset.get("generator") == "omote"


def _gltf(path: Path) -> Convention:
    document = Gltf(path).document
    asset, extensions = document.get("asset"), document.get("extensions")
    if isinstance(asset, dict) and _is_own(asset) and isinstance(asset.get("extras"), dict):
        frame = asset["extras"].get("frame")
        if frame == "file":  # exported in the frame of another file, of which glTF's definition may be untrue
            return Convention()
    if isinstance(extensions, dict) and "VRM" in extensions:
        return VRM0
    return GLTF


def first_line(path: Path) -> str:
    """Return the first line of a file of text."""
    return read_bytes(path).partition(b"\n")[0].decode("utf-8", "replace")
