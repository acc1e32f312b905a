"""drivers.sim.servos.simulators: the servos that drivers expect and that ``omote simulate`` serves."""

from __future__ import annotations

import pytest

from drivers.base.errors import DriverError
from drivers.core.traffic import Decoder1, Decoder2
from drivers.packets import packet1 as one
from drivers.sim.boards.ssc32 import Ssc32
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.simulators import DYNAMIXEL, FEETECH, DynamixelOptions, FeetechOptions, ids_and_models
from drivers.sim.wire.simulator import Setting, Simulator

SETTING = Setting(now_s=2.0, baud=57_600, seed=3)


def described(line: object) -> list[tuple[int, str, int]]:
    assert isinstance(line, Chain)
    return [(servo.id, servo.table.model, servo.baud) for servo in line.servos]


def test_ids_and_specs_become_ids_with_models():
    class Spec:
        id, model = 7, "xl320"

    assert ids_and_models([2, Spec(), "4"], "ax-12a") == [(2, "ax-12a"), (7, "xl320"), (4, "ax-12a")]


@pytest.mark.parametrize("simulator", [DYNAMIXEL, FEETECH])
def test_a_drivers_far_end_has_its_servos_at_the_wires_rate(simulator: Simulator):
    line = simulator.far_end([(1, "xl330-m288"), (4, "ax-12a")], {}, SETTING)
    assert described(line) == [(1, "xl330-m288", 57_600), (4, "ax-12a", 57_143)]
    assert line.servos[0].drive.born_s == 2.0
    other = simulator.far_end([(1, "xl330-m288")], {}, Setting(now_s=2.0, baud=57_600, seed=4))
    assert line.faults._rng.random() != other.faults._rng.random()


def test_what_is_served_alone_has_the_options_ids_and_model():
    line = DYNAMIXEL.alone(DynamixelOptions(ids="1-2,9", model="xm430-w350"), Setting(now_s=0.0, baud=1_000_000))
    assert described(line) == [(i, "xm430-w350", 1_000_000) for i in (1, 2, 9)]
    assert len(DYNAMIXEL.alone(DynamixelOptions(), SETTING).servos) == 24
    assert [model for _, model, _ in described(FEETECH.alone(FeetechOptions(), SETTING))] == ["sts3215"] * 6
    assert FeetechOptions().baud == DynamixelOptions().baud == 1_000_000


@pytest.mark.parametrize(
    ("simulator", "options"),
    [(DYNAMIXEL, DynamixelOptions(model="sts3215")), (FEETECH, FeetechOptions(model="xl320"))],
)
def test_a_model_of_the_other_maker_is_refused(simulator: Simulator, options: DynamixelOptions):
    with pytest.raises(DriverError, match=options.model):
        simulator.alone(options, SETTING)


def test_traffic_is_decoded_by_the_servos_protocol():
    def decoder(*servos: tuple[int, str]) -> object:
        return DYNAMIXEL.decoder(DYNAMIXEL.far_end(servos, {}, SETTING))

    assert isinstance(decoder((1, "xl320")), Decoder2)
    assert isinstance(decoder((1, "xl320"), (2, "ax-12a")), Decoder1)
    assert isinstance(DYNAMIXEL.decoder(Ssc32()), Decoder2)
    read = decoder((3, "ax-12a")).feed(True, one.encode(3, one.Instruction1.READ, b"\x24\x02"))
    assert "Present Position" in read[0]
