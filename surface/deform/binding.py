"""The arrays of a deformation as one table of addresses, see :mod:`surface.base.addresses`.

The table is made again whenever one of them is replaced.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg"
from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surface.base.addresses import flat, make_table, wide
from surface.base.jit import merged

NAMES = (
    "cell_start", "tile_start", "rows", "room", "at", "ids_at", "ids", "value", "slope",
    "point_start", "point_count", "point_cell", "point_row",
    "points", "origin", "inv_w", "dw", "numerators", "differences", "vertices", "normals",
    "ranges", "hits", "affected", "recomputed", "moved_ids", "delta", "local", "scratch",
    "pull", "span", "drift", "extent",
    "rows_at", "picks_at", "factor_u", "factor_v", "factors", "picks",
    "packed_at", "tile_entry", "entry_row", "packed", "packed_slope", "places_at", "places", "order_at", "order",
    "touched", "heavy", "starts", "power",
)  # fmt: skip
"""The arrays of an update in the order of the tuple ``arrays``: of :class:`.lists.Lists`, then of :mod:`.deformation`,
then of :class:`.factors.Factors` and :class:`.packing.Packed`; then which tiles an update touches,
how much all weights at a vertex of a cell may add up to, scratch space for factorized sums, and the exponents of packed
weights.

Kernels unpack that tuple once.
"""


def address_table(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return (2 k,) int64: address and length of the k arrays of ``NAMES``; the arrays must outlive the table."""
    return make_table({name: arrays[name] for name in NAMES})


@merged
def arrays_of(table):
    """Return the arrays of a table; types and widths are in the order of ``NAMES``."""
    return (
        flat(table, 0, np.int64), flat(table, 1, np.int64), flat(table, 2, np.int64), flat(table, 3, np.int64),
        flat(table, 4, np.int64), flat(table, 5, np.int64), flat(table, 6, np.int32), flat(table, 7, np.float32),
        flat(table, 8, np.float32), flat(table, 9, np.int64), flat(table, 10, np.int64),
        flat(table, 11, np.int32), flat(table, 12, np.int32), wide(table, 13, 3, np.float64),
        wide(table, 14, 3, np.float64), flat(table, 15, np.float32), flat(table, 16, np.float32),
        flat(table, 17, np.float32), flat(table, 18, np.int64), flat(table, 19, np.float32),
        flat(table, 20, np.float32), wide(table, 21, 2, np.int64), flat(table, 22, np.int64),
        flat(table, 23, np.int32), flat(table, 24, np.int32), flat(table, 25, np.int64),
        wide(table, 26, 3, np.float64), wide(table, 27, 3, np.float32), flat(table, 28, np.float32),
        flat(table, 29, np.float64), flat(table, 30, np.float64), flat(table, 31, np.float64),
        flat(table, 32, np.float64),
        flat(table, 33, np.int64), flat(table, 34, np.int64), flat(table, 35, np.int32), flat(table, 36, np.int32),
        flat(table, 37, np.float32), flat(table, 38, np.int32),
        flat(table, 39, np.int64), flat(table, 40, np.int64), flat(table, 41, np.uint16),
        flat(table, 42, np.uint8), flat(table, 43, np.int16), flat(table, 44, np.int64),
        flat(table, 45, np.uint16), flat(table, 46, np.int64), flat(table, 47, np.uint16),
        flat(table, 48, np.uint8), flat(table, 49, np.float64), flat(table, 50, np.int32),
        flat(table, 51, np.int16),
    )  # fmt: skip
