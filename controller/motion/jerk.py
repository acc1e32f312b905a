"""Limits jerk by a moving mean.

If acceleration never exceeds A, the mean over a window of T seconds changes its acceleration by at most 2 A / T per
second: the newest value enters the mean while the oldest leaves it. So a window of T = 2 A / J keeps the jerk below J.
A mean also stays inside the limits of range, speed and acceleration. The delay is T / 2.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Flags, Floats


class JerkFilter:
    """Averages (n,) values, each over its own window.

    Parameters
    ----------
    max_acceleration : (n,) units/s^2, a limit that the given values already keep.
    max_jerk : (n,) units/s^3; infinity for no limit.

    Attributes
    ----------
    window_s : (n,) length of each value's window (s).
    """

    def __init__(self, max_acceleration: Floats, max_jerk: Floats) -> None:
        self.window_s = 2.0 * max_acceleration / max_jerk
        self._longest_s = float(self.window_s.max(initial=0.0))
        self._history = np.zeros((2, len(self.window_s)))  # newest first
        self._steps_s = np.full(2, np.inf)  # time since the next older row
        self._weights, self._work = np.zeros_like(self._history), np.zeros_like(self._history)
        self._uniform = False

    @property
    def active(self) -> bool:
        """Whether the jerk of any value is limited."""
        return self._longest_s > 0.0

    def reset(self, values: Floats) -> None:
        """Start again from rest at ``values`` : (n,)."""
        self._history[:] = values
        self._steps_s.fill(np.inf)
        self._uniform = False

    def reset_some(self, where: Flags, values: Floats) -> None:
        """Start again from rest the values for which ``where`` : (n,) is True, at those of ``values`` : (n,)."""
        self._history[:, where] = values[where]

    def step(self, dt: float, values: Floats, out: Floats) -> Floats:
        """Add ``values`` : (n,), reached ``dt`` s after the last ones, and write their mean to ``out`` : (n,)."""
        unchanged = self._uniform and self._steps_s[0] == dt  # equal steps leave the weights as they are
        if not unchanged and self._steps_s[:-2].sum() < self._longest_s - dt:
            self._grow()
        self._history[1:] = self._history[:-1]
        self._history[0] = values
        if not unchanged:
            self._steps_s[1:] = self._steps_s[:-1]
            self._steps_s[0] = dt
            self._uniform = bool((self._steps_s == dt).all())
            self._update_weights()
        np.multiply(self._weights, self._history, out=self._work)
        return np.add.reduce(self._work, axis=0, out=out)

    def _update_weights(self) -> None:
        """Compute the weight of each stored row in the mean over the window.

        The mean is that of the piecewise linear curve through the rows. Where the window is longer than the stored
        history, the oldest row gets the remaining weight.
        """
        weights, before_s = self._weights, 0.0
        weights.fill(0.0)
        for i, step_s in enumerate(self._steps_s[:-1].tolist()):
            part_s = np.clip(self.window_s - before_s, 0.0, step_s)  # time of the window between this row and the next
            next_ = part_s * part_s / (2.0 * step_s)
            weights[i] += part_s - next_
            weights[i + 1] += next_
            before_s += step_s
        weights[-1] += np.maximum(self.window_s - before_s, 0.0)
        weights /= np.where(self.window_s > 0.0, self.window_s, 1.0)
        weights[0, self.window_s == 0.0] = 1.0

    def _grow(self) -> None:
        """Double the number of stored rows; happens only until the length of the steps is steady."""
        more = len(self._steps_s)
        self._history = np.concatenate([self._history, np.repeat(self._history[-1:], more, axis=0)])
        self._steps_s = np.concatenate([self._steps_s, np.full(more, self._steps_s[-1])])
        self._weights, self._work = np.zeros_like(self._history), np.zeros_like(self._history)
