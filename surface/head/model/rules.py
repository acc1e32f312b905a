"""Amounts of all groups of a pose: those of the shapes, and products of them for wrinkles and corrective shapes."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.errors import HeadFileError
from surface.base.jit import nonallocating
from surface.head.model.data import Rule, Seal
from surface.head.model.parameters import SHAPES, SIDES

ROUNDS = {"mouthPucker": 1.2, "mouthFunnel": 0.7, "tongueOut": -2.0}
"""Shares of shapes in how round an open mouth is: the orbicularis draws the lips together at its corners."""
_JAW, _CLOSE, _TORN = SHAPES.index("jawOpen"), SHAPES.index("mouthClose"), (0.3, 0.8)
"""Amounts of jawOpen, less mouthClose, between which rounded lips are drawn apart again."""


class Drivers:
    """Computes amounts of all groups: the 52 shapes, then those of ``rules``, in order; ``where`` names the file.

    Raises HeadFileError: a rule names something that is no shape.
    """

    def __init__(self, rules: list[Rule], where: str = "head") -> None:
        self.names = (*SHAPES, *(r.group for r in rules))
        terms = [(i, term) for i, rule in enumerate(rules) for term in rule.terms]
        mix = np.zeros((len(terms), len(SHAPES)))
        for row, (i, term) in zip(mix, terms, strict=True):
            for name, share in term.items():
                if name not in SHAPES:
                    raise HeadFileError(
                        f"{where}: rules[{i}]: no shape {name!r}",
                        hint="names are ARKit's, as omote render --sheet -o sheet.png shows them",
                    )
                row[SHAPES.index(name)] = share
        self._power = np.array([r.power for r in rules])
        first = np.cumsum([0, *(len(r.terms) for r in rules)])
        rows, shape = np.nonzero(mix)
        start = np.searchsorted(rows, np.arange(len(mix) + 1))
        self._terms = first.astype(np.int64), start.astype(np.int64), shape, mix[rows, shape], self._power
        self._amounts = np.zeros(len(self.names))
        self._of: Floats | None = None

    def amounts(self, shapes: Floats) -> Floats:
        """Return (52 + r,): from the shapes (52,), overwritten by the next call; computed once for all parts of a head,
        which pass the same array."""
        if shapes is self._of:
            return self._amounts
        self._of = shapes
        self._amounts[: len(SHAPES)] = shapes
        if len(self._power):
            multiply_terms(shapes, *self._terms, self._amounts)
        return self._amounts


@nonallocating
def multiply_terms(
    shapes: Floats, first: Ints, start: Ints, shape: Ints, share: Floats, power: Floats, out: Floats
) -> None:  # fmt: skip
    """Write the amounts of rules behind those of the shapes (s,) in ``out (s + r,)``: of rule r the product of terms
    ``first[r]`` to ``first[r + 1]``, limited to 0..1, to its ``power``. Term t adds up ``share`` of each ``shape`` from
    ``start[t]`` to ``start[t + 1]``."""
    for r in range(len(power)):
        amount = 1.0
        for t in range(first[r], first[r + 1]):
            term = 0.0
            for e in range(start[t], start[t + 1]):
                term += share[e] * shapes[shape[e]]
            amount *= min(max(term, 0.0), 1.0)
        out[len(shapes) + r] = amount if power[r] == 1.0 else amount ** power[r]


class SealDriver:
    """Computes how firmly a pose keeps lips together, from the shapes; 0 without a seal."""

    def __init__(self, seal: Seal | None) -> None:
        self._seal, self._amount = seal, 0.0
        self._of: Floats | None = None
        self._own = 0.0
        shares = seal.opens if seal else {}
        self._rounds = [(SHAPES.index(name), share) for name, share in ROUNDS.items()]
        self._rows = np.array([[0.0 if n.endswith(other) else shares.get(n, 0.0) for n in SHAPES]
                               for other in reversed(SIDES)])  # fmt: skip

    def amount(self, shapes: Floats, own: float = 0.0) -> float:
        """Return 1 while lips stay together, 0 where they are parted, smooth between; ``shapes (52,)``.

        own : what a user's own changes add to what opens them. Computed once for the same array and the same ``own``.
        """
        if self._seal is not None and (shapes is not self._of or own != self._own):
            self._of, self._own, self._amount = shapes, own, self._at(shapes, own, self._seal)
        return self._amount

    def rounding(self, shapes: Floats) -> float:
        """Return how round an open mouth is, 0..1: as far as shapes pucker that keep the lips together.

        A pucker that parts lips by itself, as drawn characters have it, is round as its maker drew it. A tongue that is
        put out holds the corners apart, and a jaw that opens wide draws them apart.
        """
        if self._seal is None or self._seal.opens.get("mouthPucker", 0.0) >= 0.0:
            return 0.0
        puckered = sum(share * shapes[k] for k, share in self._rounds)
        if puckered <= 0.0:
            return 0.0
        t = min(max((shapes[_JAW] - shapes[_CLOSE] - _TORN[0]) / (_TORN[1] - _TORN[0]), 0.0), 1.0)
        return float(min(puckered, 1.0) * (1.0 - t * t * (3.0 - 2.0 * t)))

    def _at(self, shapes: Floats, own: float, seal: Seal) -> float:
        low, high = seal.closed, seal.parted
        t = min(max((float((self._rows @ shapes).max()) + own - low) / (high - low), 0.0), 1.0)
        return 1.0 - t * t * (3.0 - 2.0 * t)
