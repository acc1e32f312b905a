"""The tree of errors: one root, a message and a hint."""

from __future__ import annotations

import pytest

from surface.base import errors


@pytest.mark.parametrize("name", ["HeadFileError", "FitError", "ExportError", "SurfaceFileError", "ViewError"])
def test_every_error_is_a_surface_error_with_a_hint(name: str) -> None:
    error = getattr(errors, name)("what failed", hint="what to type")
    assert isinstance(error, errors.SurfaceError)
    assert (str(error), error.hint) == ("what failed", "what to type")


def test_a_hint_may_be_left_out() -> None:
    assert errors.SurfaceError("what failed").hint == ""
