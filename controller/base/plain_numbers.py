"""The one way in which numbers are written in lines, scripts and formulas: plain decimals with a point.

What Python's own ``float`` takes besides (``1_000``, ``nan``, ``inf``, digits of other scripts) is no number here.
"""

from __future__ import annotations

import math
import re

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")


def plain_number(text: str) -> float | None:
    """The value of a number in plain decimal notation, as ``-0.5``, ``.8`` or ``1e-3``; None for any other text."""
    if _NUMBER.fullmatch(text) is None:
        return None
    value = float(text)
    return value if math.isfinite(value) else None
