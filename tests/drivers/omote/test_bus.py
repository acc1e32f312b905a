"""drivers.omote.bus with another omote at the far end: its own line session on a real pseudo-terminal."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.layers.commands import CommandState
from controller.links.line.session import LineSession
from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import NoReply, WrongModel
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import settle

QUARTER = np.pi / 2  # 90 degrees are 1 of a parameter


@contextmanager
def other_omote() -> Iterator[tuple[str, CommandState, LineSession]]:
    """A line session behind a pseudo-terminal."""
    master, slave = os.openpty()
    os.set_blocking(master, False)
    stop_r, stop_w = os.pipe()
    state = CommandState(PARAMETERS)
    session = LineSession(state, time.monotonic_ns())

    def serve() -> None:
        while stop_r not in (ready := select.select([master, stop_r], [], [])[0]):
            if master in ready:
                os.write(master, session.feed(os.read(master, 4096), time.monotonic_ns()))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave), state, session
    finally:
        os.write(stop_w, b"x")
        thread.join()
        for fd in (master, slave, stop_r, stop_w):
            os.close(fd)


def head(path: str, names: dict[str, tuple[float, float]], **options: object) -> Bus:
    servos = [
        ServoSpec(i, f"channel {i}", "parameter", low * QUARTER, high * QUARTER, 50.0, 900.0, wire_name=name)
        for i, (name, (low, high)) in enumerate(names.items())
    ]
    return open_bus("omote", servos, port=path, margin_s=0.2, **options)


def shown(state: CommandState) -> np.ndarray:
    values = PARAMETERS.neutral()
    for _ in range(300):  # three seconds of its own clock: the face's motion limits have their time
        shown.now += 10_000_000
        state.tick(shown.now, 0.01, values)
    return values


shown.now = time.monotonic_ns()


@pytest.mark.parametrize("checksum", [True, False])
def test_another_omote_makes_the_face_and_lets_go_at_the_end(checksum: bool) -> None:
    wanted = {"jawOpen": 0.8, "headYaw": -0.5, "mouthSmileLeft": 0.25}
    with other_omote() as (path, state, session):
        limits = {name: (PARAMETERS.low[PARAMETERS.index(name)], 1.0) for name in wanted}
        with head(path, limits, checksum=checksum) as bus:
            bus.start()
            target = np.array(list(wanted.values())) * QUARTER
            settle(bus, target, 1e-3, measured=False)
            values = shown(state)
            assert [values[PARAMETERS.index(name)] for name in wanted] == pytest.approx(list(wanted.values()), abs=1e-3)
            assert state.status()["manual"] == 3
        assert state.status()["manual"] == 0
        assert session.refused == {}


def test_all_parameters_go_over_in_lines_that_fit() -> None:
    limits = {name: (low, 1.0) for name, low in zip(PARAMETERS.names, PARAMETERS.low, strict=True)}
    with other_omote() as (path, state, session):
        with head(path, limits) as bus:
            bus.start()
            sent = np.full(len(limits), 0.3) * QUARTER
            settle(bus, sent, 1e-3, measured=False)
            assert state.status()["manual"] == len(PARAMETERS)
        assert session.refused == {}
        assert state.status()["manual"] == 0


def test_it_begins_from_what_the_other_shows() -> None:
    with other_omote() as (path, state, _):
        state.set_parameters([PARAMETERS.index("jawOpen")], [0.6], time.monotonic_ns())
        shown(state)
        with head(path, {"jawOpen": (0.0, 1.0)}) as bus:
            bus.start()
            assert bus.read().position_rad == pytest.approx([0.6 * QUARTER], abs=1e-3)


def test_a_name_the_other_does_not_know_moves_nothing() -> None:
    with other_omote() as (path, state, _):
        bus = head(path, {"jawOpen": (0.0, 1.0), "jawOpn": (0.0, 1.0)})
        with bus, pytest.raises(WrongModel, match="did you mean 'jawOpen'"):
            bus.start()
        assert state.status()["manual"] == 0


def test_a_line_that_is_refused_is_counted_and_the_rest_goes_on() -> None:
    with other_omote() as (path, state, session):
        with head(path, {"jawOpen": (0.0, 2.0)}) as bus:
            bus.start()
            settle(bus, [1.0 * QUARTER], 1e-3, measured=False)
            for _ in range(20):
                bus.write([1.5 * QUARTER])
                bus.read()
                time.sleep(0.005)
            assert bus.report().errors["refused"] > 0
            assert shown(state)[PARAMETERS.index("jawOpen")] == pytest.approx(1.0, abs=1e-3)
        assert set(session.refused) == {24}


def test_silence_at_the_far_end_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.omote.bus.HELLO_S", 0.3)
    monkeypatch.setattr("drivers.omote.bus.HELLO_AGAIN_S", 0.1)
    master, slave = os.openpty()
    bus = head(os.ttyname(slave), {"jawOpen": (0.0, 1.0)})
    with bus, pytest.raises(NoReply, match="no head answers") as caught:
        bus.start()
    assert "baud" in caught.value.hint
    os.close(master)
    os.close(slave)


def test_values_have_the_decimals_of_their_model() -> None:
    models = ("parameter", "degrees", "rc-180")
    servos = [ServoSpec(i, f"s{i}", model, -1.0, 1.0, 50.0, 900.0) for i, model in enumerate(models)]
    board = VirtualBus(servos, "omote", baud=115_200)
    with board.bus() as bus:
        bus.start()
        for _ in range(200):
            bus.write([0.123456789] * 3)
            bus.read()
            board.clock.sleep(0.01)
        parameter, degrees, pulse = (row["value"] for row in board.line.describe(board.clock()))
        assert parameter == pytest.approx(round(0.123456789 / QUARTER, 4), abs=1e-9)
        assert degrees == pytest.approx(round(np.degrees(0.123456789), 2), abs=1e-9)
        assert pulse == pytest.approx(round(pulse, 1), abs=1e-9)
        assert pulse != round(pulse), "tenths of a microsecond are sent"
