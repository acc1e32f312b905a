"""Bytes to motors and back: servo buses, and simulated ones that keep the same contract.

In: goals in rad, and a robot's buses. Out: packets on wires, measured states. Imports nothing of surface or controller;
drivers are imported when they are asked for, so a missing vendor package never breaks anything else.
"""

from drivers.core.registry import SIMULATED, check_model, kinds, open_bus

__all__ = ["SIMULATED", "check_model", "kinds", "open_bus"]
