"""Drivers of servo buses and boards, and simulated buses that implement the same contract.

In: goals in rad, and a robot's buses. Out: packets on wires, measured states. Imports nothing of surface or controller;
drivers are imported on first use, so a missing vendor package never breaks anything else.
"""

from drivers.core.registry import SIMULATED, check_model, kinds, open_bus

__all__ = ["SIMULATED", "check_model", "kinds", "open_bus"]
