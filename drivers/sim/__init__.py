"""Simulated servo buses that any program can open: byte-exact devices behind a pseudo-terminal.

``SimulatedBus`` serves one from a thread or a child process; ``serve_dynamixel`` serves until interrupted.
"""

from drivers.sim.serve import serve_dynamixel
from drivers.sim.simulated import ServoView, SimulatedBus

__all__ = ["ServoView", "SimulatedBus", "serve_dynamixel"]
