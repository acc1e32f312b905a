"""Addresses of work arrays."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface import DCPSurface
from surface.deform.binding import NAMES, address_table
from surface.deform.deformation import Deformation


def arrays_of(deformation: Deformation[DCPSurface]) -> dict[str, np.ndarray]:
    """All arrays of an update by name."""
    return vars(deformation.lists) | deformation._arrays | deformation.storage.arrays


def test_the_table_holds_address_and_length_of_every_array() -> None:
    surface = shapes.hills(8)
    arrays = arrays_of(surface.deformation(surface.tessellate(chord_error=1.0)))
    table = address_table(arrays).reshape(-1, 2)
    assert len(table) == len(NAMES)
    for (address, length), name in zip(table, NAMES, strict=True):
        assert (address, length) == (arrays[name].ctypes.data, len(arrays[name])), name


def test_an_array_with_gaps_is_refused() -> None:
    surface = shapes.hills(8)
    arrays = arrays_of(surface.deformation(surface.tessellate(chord_error=1.0)))
    arrays["delta"] = np.zeros((8, 6))[:, ::2]
    with pytest.raises(ValueError, match="delta: must be contiguous"):
        address_table(arrays)


def test_replaced_arrays_are_found_by_the_next_update() -> None:
    surface = shapes.hills(8)
    deformation = surface.deformation(surface.tessellate(chord_error=1.0))
    deformation.move([20], [[0.0, 0, 1]])
    deformation.set_knots(20, [0.0, 0.1, 0.3, 0.8, 1.0], [0.0, 0.1, 0.3, 0.8, 1.0])  # longer lists: other arrays
    deformation.move([20], [[0.0, 0, 1]])
    fresh = deformation.surface.evaluate(deformation.mesh.uv)
    assert np.abs(deformation.vertices - fresh).max() < 1e-4
