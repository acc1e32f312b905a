"""The simulated far end of each family, from plain values, as they travel to a child process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from drivers.sim.boards.linehead import LineHead
from drivers.sim.boards.maestro import Maestro
from drivers.sim.boards.ssc32 import Ssc32
from drivers.sim.boards.textboard import TextBoard
from drivers.sim.serving.serve import make_chain, make_servos
from drivers.sim.servos.chain import Chain
from drivers.sim.wire.line import Line

Servos = Sequence[tuple[int, Any]]
"""(id, model) of each servo."""

MAESTRO_SIZES = (6, 12, 18, 24)


class _Entry:
    """An id with a model, as ``make_servos`` takes it."""

    def __init__(self, device_id: int, model: str | int) -> None:
        self.id, self.model = device_id, model


def make_line(
    family: str, servos: Servos, now_s: float, *, baud: int = 1_000_000, seed: int = 0, options: Mapping[str, Any] = {}
) -> Line:
    """What a simulated bus of a family has at its far end.

    Parameters
    ----------
    family : a kind of bus, as ``drivers.KINDS`` names it; servos with control tables know their protocol themselves.
    servos : id and model of each. now_s : time.
    baud : rate at which servos with control tables listen. seed : of random faults.
    options : what the family's driver gives as ``far_end()``.

    Raises
    ------
    DriverError : unknown model, or servos that cannot share a wire.
    """
    board = _BOARDS.get(family)
    if board is not None:
        return board(servos, now_s, seed, dict(options))
    return make_servo_chain(servos, now_s, baud, seed)


def make_servo_chain(servos: Servos, now_s: float, baud: int, seed: int) -> Chain:
    """A wire of servos with control tables."""
    return make_chain(make_servos([_Entry(*servo) for servo in servos], 0, baud, now_s), now_s, seed)


def _maestro(servos: Servos, now_s: float, seed: int, options: dict[str, Any]) -> Line:
    highest = max(device_id for device_id, _ in servos)
    sizes = MAESTRO_SIZES if options.pop("board", "mini") == "micro" else MAESTRO_SIZES[1:]
    channels = next((size for size in sizes if highest < size), sizes[-1])
    return Maestro(channels, now_s, seed=seed, **options)


def _ssc32(servos: Servos, now_s: float, seed: int, options: dict[str, Any]) -> Line:
    return Ssc32(now_s, seed=seed)


def _text(servos: Servos, now_s: float, seed: int, options: dict[str, Any]) -> Line:
    return TextBoard(ids=[device_id for device_id, _ in servos], now_s=now_s, seed=seed, **options)


def _omote(servos: Servos, now_s: float, seed: int, options: dict[str, Any]) -> Line:
    return LineHead(now_s=now_s, seed=seed, **options)


_BOARDS: dict[str, Callable[[Servos, float, int, dict[str, Any]], Line]] = {
    "maestro": _maestro,
    "ssc32": _ssc32,
    "text": _text,
    "omote": _omote,
}
