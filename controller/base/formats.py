"""Versions of the files that omote writes: a whole number that grows when older readers could misread a file."""

from __future__ import annotations

NEWER = "written by a newer omote"


def format_fault(found: object, newest: int) -> str | None:
    """What is wrong with the version that a file states, in words; None when this omote reads it.

    Parameters
    ----------
    found : what the file states. newest : the newest version that the reader knows.
    """
    if isinstance(found, bool) or not isinstance(found, int) or found < 1:
        return f"format: must be a whole number from 1 (is {found!r})"
    if found > newest:
        return f"format: is {found}, {NEWER}; this one reads up to {newest}"
    return None
