"""Simulators of the families Dynamixel and Feetech: their chains of servos and the options of ``omote simulate``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from drivers.base.options import option, parse_ids
from drivers.core.traffic import Decoder, Decoder1, Decoder2
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import Servos, Setting, Simulator
from drivers.tables.models import check_dynamixel, check_feetech


def ids_and_models(servos: Iterable[Any], model: str | int) -> list[tuple[int, str | int]]:
    """(id, model) of servos given as ids, which get `model`, or as specs with ``id`` and ``model``."""
    return [(int(getattr(servo, "id", servo)), getattr(servo, "model", model)) for servo in servos]


@dataclass(frozen=True, kw_only=True)
class DynamixelOptions:
    """Options of ``omote simulate dynamixel``."""

    ids: str = option("Ids of the servos: 1-24 or 1,3,7-9.", "1-24")
    model: str = option("Model of the servos.", "xl330-m288")
    baud: int = option("Baud rate the servos listen at.", 1_000_000, at_least=300)


@dataclass(frozen=True, kw_only=True)
class FeetechOptions(DynamixelOptions):
    """Options of ``omote simulate feetech``."""

    ids: str = option("Ids of the servos: 1-24 or 1,3,7-9.", "1-6")
    model: str = option("Model of the servos.", "sts3215")


def _far_end(servos: Servos, options: Mapping[str, Any], setting: Setting) -> Chain:
    made = [SimulatedServo(servo, model, now_s=setting.now_s, baud=setting.baud) for servo, model in servos]
    return Chain(made, setting.now_s, seed=setting.seed)


def _alone(check_model: Callable[[str], object], options: DynamixelOptions, setting: Setting) -> Chain:
    check_model(options.model)
    return _far_end([(servo, options.model) for servo in parse_ids(options.ids)], {}, setting)


def _decoder(line: Line) -> Decoder:
    tables = {servo.id: servo.table for servo in line.servos} if isinstance(line, Chain) else {}
    return (Decoder1 if any(table.protocol == 1 for table in tables.values()) else Decoder2)(tables)


DYNAMIXEL = Simulator(
    far_end=_far_end,
    alone=partial(_alone, check_dynamixel),
    options=DynamixelOptions,
    decoder=_decoder,
    help="""Serve simulated Dynamixel servos until interrupted; prints `ready PATH`.

    AX and MX models speak Protocol 1.0.

    Example: omote simulate dynamixel --ids 1-24 --model xl330-m288 --link /tmp/head
    """,
)
FEETECH = Simulator(
    far_end=_far_end,
    alone=partial(_alone, check_feetech),
    options=FeetechOptions,
    decoder=_decoder,
    help="""Serve simulated Feetech STS or SCS servos until interrupted; prints `ready PATH`.

    Example: omote simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    """,
)
