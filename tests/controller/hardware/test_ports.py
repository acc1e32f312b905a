"""controller.hardware.ports: the port of a bus that tools open in turn, and which of its servos hold."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from controller.hardware import ports
from controller.hardware.ports import BusPort, serve_bus

SERVOS: Any = [SimpleNamespace(id=k, name=f"servo{k}") for k in (1, 2, 3)]


class Opened:
    """Notes how a bus is opened; of its servos 2 holds, and 9, which is not meant, too."""

    def __init__(self) -> None:
        self.asked = list[tuple[Any, ...]]()

    def __call__(self, family: str, servos: Any, **how: Any) -> Any:
        self.asked.append((family, [servo.id for servo in servos], how))

        @contextmanager
        def bus() -> Any:
            yield SimpleNamespace(
                discover=lambda ids: [SimpleNamespace(id=k, torque=k in (2, 9)) for k in (*ids, 9)],
            )

        return bus()


@pytest.mark.parametrize(("hobby", "holding"), [(False, ["servo2"]), (True, [])])
def test_servos_whose_torque_is_on_are_named(monkeypatch: pytest.MonkeyPatch, hobby: bool, holding: list[str]) -> None:
    opened = Opened()
    monkeypatch.setattr(ports, "open_bus", opened)
    monkeypatch.setattr(ports, "FAMILIES", SimpleNamespace(get=lambda family: SimpleNamespace(hobby=hobby)))
    port = BusPort("head", "dynamixel", "/dev/a", 57_600, {"fast": True})
    assert port.holding(SERVOS) == holding
    how = {"port": "/dev/a", "baud": 57_600, "fast": True}
    assert opened.asked == ([] if hobby else [("dynamixel", [1, 2, 3], how)])
    port.bus(SERVOS[:1], fast=False, margin_s=2.0)
    assert opened.asked[-1] == ("dynamixel", [1], {**how, "fast": False, "margin_s": 2.0})


def test_a_real_bus_is_at_its_own_port_with_the_options_of_its_driver() -> None:
    options = {"port": "/dev/a", "baud": 57_600, "fast": True, "wire": False, "faults": [], "seed": 3, "latency_s": 0.0}
    bus: Any = SimpleNamespace(
        kind="dynamixel", family="dynamixel", name="head", port="/dev/a", baud=57_600, options=lambda: options
    )
    with serve_bus(bus, SERVOS) as port:
        assert port == BusPort("head", "dynamixel", "/dev/a", 57_600, {"fast": True})
