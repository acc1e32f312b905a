"""What stands in for families of servos with control tables, and what ``omote simulate`` can be told of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from drivers.base.options import option, parse_ids
from drivers.core.traffic import Decoder, Decoder1, Decoder2
from drivers.sim.servos.bus import SimulatedChain
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.legacy import LegacyChain
from drivers.sim.servos.mixed import MixedChain
from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import Servos, Setting, Simulator
from drivers.tables.tables import check_dynamixel, check_feetech


def make_servos(servos: Iterable[object], model: str | int, baud: int, now_s: float) -> list[SimulatedServo]:
    """Simulated servos for ids, or for anything that has an ``id`` and a ``model`` (a ``ServoSpec``)."""
    return [
        SimulatedServo(
            int(getattr(servo, "id", servo)),  # type: ignore[call-overload]
            getattr(servo, "model", model),
            now_s=now_s,
            baud=baud,
        )
        for servo in servos
    ]


def make_chain(servos: list[SimulatedServo], now_s: float, seed: int = 0) -> Chain:
    """A wire with these servos, of the protocol they speak, or of both."""
    protocols = {servo.table.protocol for servo in servos}
    if len(protocols) > 1:
        return MixedChain(servos, now_s, seed=seed)
    kind = LegacyChain if protocols == {1} else SimulatedChain
    return kind(servos, now_s, seed=seed)


@dataclass(frozen=True, kw_only=True)
class DynamixelOptions:
    """What ``omote simulate dynamixel`` can be told."""

    ids: str = option("Ids of the servos: 1-24 or 1,3,7-9.", "1-24")
    model: str = option("Model of the servos.", "xl330-m288")
    baud: int = option("Baud rate the servos listen at.", 1_000_000, at_least=300)


@dataclass(frozen=True, kw_only=True)
class FeetechOptions:
    """What ``omote simulate feetech`` can be told."""

    ids: str = option("Ids of the servos: 1-24 or 1,3,7-9.", "1-6")
    model: str = option("Model of the servos.", "sts3215")
    baud: int = option("Baud rate the servos listen at.", 1_000_000, at_least=300)


def _far_end(servos: Servos, options: Mapping[str, Any], setting: Setting) -> Chain:
    made = [SimulatedServo(servo, model, now_s=setting.now_s, baud=setting.baud) for servo, model in servos]
    return make_chain(made, setting.now_s, setting.seed)


def _dynamixel(options: DynamixelOptions, setting: Setting) -> Chain:
    check_dynamixel(options.model)
    return _far_end([(servo, options.model) for servo in parse_ids(options.ids)], {}, setting)


def _feetech(options: FeetechOptions, setting: Setting) -> Chain:
    check_feetech(options.model)
    return _far_end([(servo, options.model) for servo in parse_ids(options.ids)], {}, setting)


def _decoder(line: Line) -> Decoder:
    tables = {servo.id: servo.table for servo in line.servos} if isinstance(line, Chain) else {}
    return (Decoder1 if any(table.protocol == 1 for table in tables.values()) else Decoder2)(tables)


DYNAMIXEL = Simulator(
    far_end=_far_end,
    alone=_dynamixel,
    options=DynamixelOptions,
    decoder=_decoder,
    help="""Serve simulated Dynamixel servos until interrupted; prints `ready PATH`.

    AX and MX models speak Protocol 1.0.

    Example: omote simulate dynamixel --ids 1-24 --model xl330-m288 --link /tmp/head
    """,
)
FEETECH = Simulator(
    far_end=_far_end,
    alone=_feetech,
    options=FeetechOptions,
    decoder=_decoder,
    help="""Serve simulated Feetech STS or SCS servos until interrupted; prints `ready PATH`.

    Example: omote simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    """,
)
