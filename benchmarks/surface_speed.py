"""The surface engine at its memory limit: ratios to what memory allows and to other ways, and how cost grows.

Run ``python benchmarks/surface_speed.py [--large] [--growth GROWTH.svg]``; ``omote bench surface`` does the same.
splinepy and geomdl stand in the table where they are installed (``pip install splinepy geomdl``). Ratios are from one
run on one machine; times alone say little.
"""

from __future__ import annotations

import typer

from controller.cli.bench import Subject, bench


def main(large: bool = False, growth: str | None = None, seconds: float = 0.3) -> None:
    """Measure and print."""
    from pathlib import Path

    bench(Subject.surface, seconds=seconds, large=large, growth=None if growth is None else Path(growth))


if __name__ == "__main__":
    typer.run(main)
