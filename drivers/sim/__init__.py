"""Simulated servo buses that any program can open: byte-exact devices behind a pseudo-terminal.

In: ids, models and faults. Out: a port, and bytes in time. Imports any room of the drivers before it.

``SimulatedBus`` serves Dynamixel or Feetech servos from a thread or a child process, ``serve_dynamixel`` serves
them until interrupted; ``serve`` does the same for a ``Maestro`` or an ``Ssc32``.
"""

from drivers.sim.boards.maestro import Maestro
from drivers.sim.boards.ssc32 import Ssc32
from drivers.sim.serving.serve import serve, serve_dynamixel
from drivers.sim.serving.simulated import ServoView, SimulatedBus

__all__ = ["Maestro", "ServoView", "SimulatedBus", "Ssc32", "serve", "serve_dynamixel"]
