"""omote's pytest fixtures: ``servo_bus``, ``servo_board``, ``robot_head`` and ``robot_host``.

Each is a function that opens simulated hardware at a port, as often as a test calls it; after the test all of it is
closed. docs/testing-your-robot.md has examples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # imported lazily: tests that use no fixture load nothing of omote
    from controller.testing.head import RobotHead
    from controller.testing.host import ScriptedHost
    from drivers.testing import ServoBoard, ServoBus


def _opener(stack: ExitStack, open_it: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function as ``open_it``, whose results the stack closes, and whose errors show their hint."""

    def opened(*words: Any, **options: Any) -> Any:
        __tracebackhide__ = True
        try:
            return stack.enter_context(open_it(*words, **options))
        except Exception as error:
            if hint := getattr(error, "hint", ""):
                error.add_note(hint)
            raise

    return opened


@pytest.fixture
def servo_bus() -> Iterator[Callable[..., ServoBus]]:
    """Opens simulated Dynamixel or Feetech servos: ``bus = servo_bus("xl330-m288", [1, 2])``, then ``bus.port``."""
    from drivers.testing import open_servos  # imported lazily: as above

    with ExitStack() as stack:
        yield _opener(stack, open_servos)


@pytest.fixture
def servo_board() -> Iterator[Callable[..., ServoBoard]]:
    """Opens a simulated board of hobby servos: ``board = servo_board("maestro", channels=12)``, then ``board.port``."""
    from controller.base.parameters import PARAMETERS  # imported lazily: as above
    from drivers.testing import open_board

    def with_names(kind: str = "maestro", **options: Any) -> ServoBoard:
        return open_board(kind, **{"parameters": PARAMETERS.names, **options})

    with ExitStack() as stack:
        yield _opener(stack, with_names)


@pytest.fixture
def robot_head(tmp_path: Any) -> Iterator[Callable[..., RobotHead]]:
    """Opens all simulated buses of a robot file: ``head = robot_head("head24")``, then ``head.port``."""
    from controller.testing.head import open_head  # imported lazily: as above

    with ExitStack() as stack:
        yield _opener(stack, lambda robot, **options: open_head(robot, folder=tmp_path, **options))


@pytest.fixture
def robot_host(tmp_path: Any) -> Iterator[Callable[..., ScriptedHost]]:
    """Opens a simulated robot host that sends the line protocol: ``host = robot_host("tour")``, then ``host.port``."""
    from controller.testing.host import open_host  # imported lazily: as above

    with ExitStack() as stack:
        yield _opener(stack, lambda script="tour", **options: open_host(script, folder=tmp_path, **options))
