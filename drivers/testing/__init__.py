"""Simulated servos and boards as a test bench: what a program did to them, when, and whether it may.

In: models and ids, or a kind of board. Out: a port, a record of writes and motion, assertions. Imports any room of the
drivers before it.

``open_servos`` and ``open_board`` give what the pytest fixtures ``servo_bus`` and ``servo_board`` give; a program
without pytest calls ``close`` at the end, or uses ``with``.
"""

from drivers.testing.bench import Bench, ServoBoard, ServoBus
from drivers.testing.opening import open_board, open_servos
from drivers.testing.records import Write

__all__ = ["Bench", "ServoBoard", "ServoBus", "Write", "open_board", "open_servos"]
