"""Optional packages and the extras that install them; missing ones are reported before work begins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from surface.base.errors import MissingPackage

EXTRAS = {
    "moderngl": ("moderngl", "view"),
    "PIL": ("Pillow", "view"),
    "imgui_bundle": ("imgui-bundle", "view"),
    "scipy": ("scipy", "fit"),
    "trimesh": ("trimesh", "fit"),
    "igl": ("libigl", "fit"),
    "rhino3dm": ("rhino3dm", "cad"),
    "mediapipe": ("mediapipe", "webcam"),
    "cv2": ("opencv-python-headless", "webcam"),
    "mcap": ("mcap", "mcap"),
    "zenoh": ("eclipse-zenoh", "zenoh"),
    "rosbags": ("rosbags", "ros2"),
    "onnxruntime": ("onnxruntime", "onnx"),
    "pylsl": ("pylsl", "lsl"),
    "websockets": ("websockets", "web"),
}
"""Name of a package and the extra of pyproject.toml that installs it, by the name of its module."""


def require(what: str, *modules: str) -> None:
    """Check that packages are installed, without importing them; ``what`` is what needs them, such as "the window".

    Raises MissingPackage, which names the packages that are missing and the command that installs them.
    """
    missing = [EXTRAS[module] for module in modules if find_spec(module) is None]
    if missing:
        names, extras = zip(*missing, strict=True)
        several = "packages" if len(names) > 1 else "package"
        raise MissingPackage(f"{what} needs the {several} {' and '.join(names)}: not installed", hint=_install(extras))


@contextmanager
def importing(what: str, *modules: str) -> Iterator[None]:
    """Context in which packages are imported; raise MissingPackage if one is not installed or cannot be loaded."""
    require(what, *modules)
    try:
        yield
    except ImportError as error:
        hint = f"{_install(EXTRAS[module][1] for module in modules)}, and the libraries that this message names"
        raise MissingPackage(f"{what} needs a package that cannot be loaded: {error}", hint=hint) from error


def _install(extras: Iterable[str]) -> str:
    return f"pip install 'omote[{','.join(sorted(set(extras)))}]'"
