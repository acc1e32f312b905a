"""Connected components, compiled: scipy, which has them too, is no part of the base install."""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Ints
from surface.base.jit import kernel


@kernel
def root_of(parent, k):
    """Return the node at which the chain of ``parent (n,)`` int64 from node ``k`` on ends; it becomes shorter by that
    (path halving)."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel
def _join(parent, a, b):
    """Make one component of those of the nodes ``a`` and ``b`` in ``parent (n,)``."""
    first, second = root_of(parent, a), root_of(parent, b)
    parent[max(first, second)] = min(first, second)


@kernel
def joined(count: int, a: Ints, b: Ints) -> Ints:
    """Return (count,) int64: the first node of the component of each node, where ``a (k,)`` and ``b (k,)`` are
    joined."""
    parent = np.arange(count)
    for k in range(len(a)):
        _join(parent, a[k], b[k])
    for k in range(count):
        parent[k] = root_of(parent, k)
    return parent
