"""Limits jerk by a moving mean.

Motion whose acceleration never exceeds A, averaged over a window of T seconds, changes its acceleration by no more
than 2 A / T a second: the oldest value leaves the mean while the newest comes in. So T = 2 A / J keeps a limit J
strictly, and a mean keeps range, speed and acceleration as well. It delays by T / 2.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Flags, Floats


class JerkFilter:
    """Averages (n,) values, each over its own window.

    Parameters
    ----------
    max_acceleration : (n,) units/s^2, what the values keep already.
    max_jerk : (n,) units/s^3; infinity for none.

    Attributes
    ----------
    window_s : (n,) lengths of the windows.
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
        """Whether anything has a limit."""
        return self._longest_s > 0.0

    def reset(self, values: Floats) -> None:
        """Be at rest at ``values`` : (n,)."""
        self._history[:] = values
        self._steps_s.fill(np.inf)
        self._uniform = False

    def reset_some(self, where: Flags, values: Floats) -> None:
        """Let those of ``where`` : (n,) be at rest at ``values`` : (n,)."""
        self._history[:, where] = values[where]

    def step(self, dt: float, values: Floats, out: Floats) -> Floats:
        """Take ``values`` : (n,) that were reached in ``dt`` s; write their mean to ``out`` : (n,)."""
        steady = self._uniform and self._steps_s[0] == dt
        if not steady and self._steps_s[:-2].sum() < self._longest_s - dt:
            self._grow()
        self._history[1:] = self._history[:-1]
        self._history[0] = values
        if not steady:
            self._steps_s[1:] = self._steps_s[:-1]
            self._steps_s[0] = dt
            self._uniform = bool((self._steps_s == dt).all())  # equal steps leave the weights as they are
            self._weigh()
        np.multiply(self._weights, self._history, out=self._work)
        return np.add.reduce(self._work, axis=0, out=out)

    def _weigh(self) -> None:
        """Weights of the stored rows in the mean over the window of the straight lines between them.

        The oldest row gets the rest.
        """
        share, before = self._weights, 0.0
        share.fill(0.0)
        for i, step_s in enumerate(self._steps_s[:-1].tolist()):
            part = np.clip(self.window_s - before, 0.0, step_s)  # time of the window between this row and the next
            next_ = part * part / (2.0 * step_s)
            share[i] += part - next_
            share[i + 1] += next_
            before += step_s
        share[-1] += np.maximum(self.window_s - before, 0.0)
        share /= np.where(self.window_s > 0.0, self.window_s, 1.0)
        share[0, self.window_s == 0.0] = 1.0

    def _grow(self) -> None:
        """Keep more rows; happens while the length of the steps settles, never afterwards."""
        more = len(self._steps_s)
        self._history = np.concatenate([self._history, np.repeat(self._history[-1:], more, axis=0)])
        self._steps_s = np.concatenate([self._steps_s, np.full(more, self._steps_s[-1])])
        self._weights, self._work = np.zeros_like(self._history), np.zeros_like(self._history)
