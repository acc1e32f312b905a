"""controller.hardware.bench_many: each of several buses is measured; no rate is judged here."""

from __future__ import annotations

import sys

import pytest

from controller.hardware import bench_many as module
from controller.hardware.bench_many import bench_many
from controller.tools.bench_bus import limit_hz


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
@pytest.mark.slow
def test_every_bus_has_its_own_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "request_realtime", lambda: False)
    monkeypatch.setattr(module, "shorten_thread_switches", lambda: None)
    ((title, figures),) = bench_many(2, 3, 1_000_000, 0.2, lambda text: None)
    assert title.startswith("2 buses of 3 servos")
    rates = [figure.value for figure in figures if figure.name.endswith("fast sync read")]
    assert len(rates) == 2
    assert all(0.0 < rate <= 1.01 * limit_hz(3, 1_000_000, True) for rate in rates)


@pytest.mark.parametrize(
    ("servos", "baud", "fast", "hz"),
    [
        (12, 1_000_000, False, 357.1),
        (12, 1_000_000, True, 490.2),
        (12, 4_000_000, True, 1960.8),
        (24, 4_000_000, False, 751.9),
        (12, 10_500_000, False, 3750.0),
        (24, 10_500_000, False, 1973.7),
    ],
)
def test_the_limit_at_the_rates_of_large_servos(servos: int, baud: int, fast: bool, hz: float) -> None:
    """By hand: 12 servos write 14 + 60 bytes, ask with 26, and answer with 180, or with 104 at once; P-series and
    X-series have goals and positions of four bytes alike."""
    assert limit_hz(servos, baud, fast) == pytest.approx(hz, abs=0.1)
