"""Connected components, compiled: scipy, which has them too, is no part of the base install."""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel


@kernel
def _root(parent, k):
    """Return the first node of the component of node ``k``; ``parent (n,)`` int64 leads there, in fewer steps the next
    time (path halving)."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel
def _join(parent, a, b):
    """Make one component of those of the nodes ``a`` and ``b`` in ``parent (n,)``."""
    first, second = _root(parent, a), _root(parent, b)
    parent[max(first, second)] = min(first, second)


@kernel
def _label(parent):
    """Set each of ``parent (n,)`` to the first node of its component."""
    for k in range(len(parent)):
        parent[k] = _root(parent, k)


@kernel
def joined(count: int, a: Ints, b: Ints) -> Ints:
    """Return (count,) int64: the first node of the component of each node, where ``a (k,)`` and ``b (k,)`` are
    joined."""
    parent = np.arange(count)
    for k in range(len(a)):
        _join(parent, a[k], b[k])
    _label(parent)
    return parent


@kernel
def near_each_other(points: Floats, distance: float) -> Ints:
    """Return (n,) int64: the first of the component of each of ``points (n, 3)``, where those no further apart than
    ``distance``, in their unit, are joined."""
    parent = np.arange(len(points))
    for k in range(len(points)):
        for m in range(k):
            square = 0.0
            for c in range(3):
                square += (points[k, c] - points[m, c]) ** 2
            if square <= distance * distance:
                _join(parent, k, m)
    _label(parent)
    return parent
