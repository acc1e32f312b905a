"""Normal equations of sparse rows, summed sample by sample in compiled code.

Control points overlap so much that the matrix is as good as full: a dense one is filled directly, its upper half alone.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

from surface.base.jit import kernel


@kernel
def add_normal(start, columns, data, weight, targets, matrix, right):
    """Add rows' W rows to the upper half of ``matrix (n, n)`` and rows' W targets to ``right (n, c)``.

    Parameters
    ----------
    start (m + 1,), columns, data : the rows as CSR with sorted columns; weight (m,); targets (m, c) float64.
    """
    for k in range(len(start) - 1):
        for p in range(start[k], start[k + 1]):
            share, i = data[p] * weight[k], columns[p]
            for q in range(p, start[k + 1]):
                matrix[i, columns[q]] += share * data[q]
            for c in range(targets.shape[1]):
                right[i, c] += share * targets[k, c]
