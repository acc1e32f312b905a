"""Idle torque-off: when the servos of a bus have been still and unloaded for a while, their torque may be disabled.

Servos that hold still for hours wear and warm for nothing. Torque is switched for a whole bus, because a servo without
torque beside others that move is pulled along. It is enabled again when a target changes or somebody moves a servo.
This module only decides; :class:`controller.robot.busloop.BusLoop` switches the bus.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Floats
from drivers.base.bus import BusState

_MAX_TARGET_CHANGE_RAD = np.radians(0.1)
_MAX_GOAL_ERROR_RAD = np.radians(2.0)
_MAX_DRIFT_RAD = np.radians(3.0)
_MAX_WAKES_BY_DRIFT = 2
"""After so many wakes because a servo had moved, the bus keeps its torque for the rest of the run."""


class IdleTorqueOff:
    """Decides when the torque of a bus is disabled because it is idle, and when it is enabled again.

    after_s : how long the bus must be idle; 0 means never. below_a : current below which a servo counts as unloaded.
    torque_off_count : how often torque was disabled.
    drift_wake_count : how often torque was enabled again because a servo had moved, by its load or by hand.
    """

    def __init__(self, after_s: float, below_a: float) -> None:
        self._after_s, self._below_a = after_s, below_a
        self._goals: Floats | None = None
        self._idle_s, self._target_at_off = 0.0, np.zeros(0)
        self._position_at_off: Floats | None = None
        self.torque_off_count = self.drift_wake_count = 0

    def update(self, goals: Floats, state: BusState | None, dt: float) -> bool:
        """Count ``dt`` s in which ``goals`` : (n,) rad were sent; return whether torque may be disabled now.

        It may once all servos of the bus have held these goals for ``after_s``, each at its goal and without load. A
        servo whose current is not measured counts as loaded, so its whole bus keeps its torque.
        """
        if not self._after_s or self.drift_wake_count >= _MAX_WAKES_BY_DRIFT:
            return False
        moved = self._goals is None or np.abs(goals - self._goals).max() > _MAX_TARGET_CHANGE_RAD
        if moved or state is None or not self._is_unloaded(goals, state):
            self._goals, self._idle_s = goals.copy(), 0.0
            return False
        self._idle_s += dt
        return self._idle_s >= self._after_s

    def _is_unloaded(self, goals: Floats, state: BusState) -> bool:
        at_goal = state.fresh & (np.abs(state.position_rad - goals) < _MAX_GOAL_ERROR_RAD)
        return bool((at_goal & (np.abs(state.current_a) < self._below_a)).all())

    def note_torque_off(self, target: Floats, state: BusState | None) -> None:
        """Remember that torque was disabled at these positions, while the face asked for ``target`` : (n,) rad."""
        self._position_at_off = None if state is None else state.position_rad.copy()
        self._target_at_off = target.copy()
        self._idle_s = 0.0
        self.torque_off_count += 1

    def check_wake(self, target: Floats, state: BusState) -> bool:
        """Return whether to enable torque: ``target`` : (n,) rad has changed since, or a servo moved, which is counted.

        Also True where the positions at which torque was disabled are not known.
        """
        if self._position_at_off is None or (np.abs(target - self._target_at_off) > _MAX_TARGET_CHANGE_RAD).any():
            return True
        drifted = bool((np.abs(state.position_rad - self._position_at_off) > _MAX_DRIFT_RAD).any())
        self.drift_wake_count += drifted
        return drifted
