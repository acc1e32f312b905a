"""The version of the installed omote."""

from __future__ import annotations

from functools import cache
from importlib import metadata


@cache
def package_version() -> str:
    """Version of the installed omote; ``0`` when it runs from a folder that is not installed."""
    try:
        return metadata.version("omote")
    except metadata.PackageNotFoundError:
        return "0"
