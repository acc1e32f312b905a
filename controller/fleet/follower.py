"""Follows a conductor: shows exactly what it sends, or without one the head's own layers, with smooth transitions.

There is no I/O here.
"""

from __future__ import annotations

import threading
from collections import Counter, deque

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.fleet.approach import Approach
from controller.fleet.lease import NOBODY, Token
from controller.fleet.payload import Header
from controller.motion.motion import minimum_jerk

_LIMIT_FRACTION = 0.6
"""Fraction of the speed and acceleration limits that a transition between two sources may use in addition to their own
motion. The limiter behind it keeps the limits in any case."""
_MIN_TRANSITION_S = 0.3
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.7735
"""Greatest speed (1/s) and acceleration (1/s²) of the minimum-jerk curve from 0 to 1 over one second."""
_STEP_TOLERANCE_S, _STEP_TOLERANCE_FRACTION = 5e-3, 0.45
"""A step uses the conductor's step length if it differs from the local one by less than both, the second relative to
the longer one. Ticks begin unevenly, but after a skipped tick, a step is twice as long."""
_MAX_WAITING = 128


class Follower:
    """Computes what a head shows: the faces of a conductor, or its own layers.

    Faces are passed to :meth:`take` from any thread; the control loop calls :meth:`step`.

    Parameters
    ----------
    patience_s : a conductor that is silent for this time is lost. delay_ns : time between mixing and showing a face, by
        the conductor's clock; 0 shows the newest face immediately.

    Attributes
    ----------
    highest : the highest token obeyed. taken, refused : numbers of faces, refused by reason.
    conducted : whether a conductor is followed. exact : whether the shown values equal the source's (the conductor's
    faces, or the own layers), so no transition is in progress. header : of the face that is shown.
    offset_ns : the conductor's clock minus the local clock.
    """

    def __init__(self, parameters: Parameters, patience_s: float = 0.5, delay_ns: int = 0) -> None:
        p = parameters
        self._way = Approach(p)
        self._p, self._patience_s, self._delay_ns = p, patience_s, delay_ns
        self.highest: Token = NOBODY
        self.taken, self.refused = 0, Counter[str]()
        self.conducted, self.exact = False, False
        self.header: Header | None = None
        self.offset_ns = 0
        self._lock = threading.Lock()
        self._waiting: deque[tuple[Header, Floats]] = deque(maxlen=_MAX_WAITING)
        self._sequence = -1
        self._sent = p.neutral()  # the conductor's face that was due last
        self._followed, self._followed_ns = self._sent, 0  # that face, or one interpolated to the next, and its time
        self._shown = p.neutral()
        self._passed_s = 0.0  # time in which the followed face moved since the last step
        self._theirs_s = 0.0  # that time if it is from one sent face to the next, else 0
        self._gap, self._blended_s, self._whole_s = np.zeros(len(p)), 0.0, 0.0
        self._heard_s = -np.inf
        self._begun, self._leads = False, False

    def take(self, header: Header, values: Floats) -> bool:
        """Queue a face that arrived; return False if it is refused: from a replaced conductor, or too old."""
        with self._lock:
            if header.token < self.highest:
                self.refused["of a conductor that was replaced"] += 1
                return False
            if header.token > self.highest:
                self.highest, self._sequence = header.token, -1
                self._waiting.clear()
            if header.sequence <= self._sequence:
                self.refused["older than the last one"] += 1
                return False
            self._sequence, self.taken = header.sequence, self.taken + 1
            self._waiting.append((header, values))
            return True

    @property
    def due_ns(self) -> int | None:
        """When the shown face was due, by the local clock; None without a delay or a conductor."""
        if not self._delay_ns or self.header is None or not self.conducted:
            return None
        return self.header.time_ns + self._delay_ns - self.offset_ns

    def follows(self, now_s: float) -> bool:
        """Whether a conductor is followed and not yet lost at ``now_s``, so that the own layers are not needed."""
        return self.conducted and not self._is_lost(now_s)

    def _is_lost(self, now_s: float) -> bool:
        return now_s - self._heard_s > self._patience_s

    def lead(self, token: Token) -> None:
        """Start to conduct with ``token``: no conductor with a lower token is followed from now on."""
        with self._lock:
            if token > self.highest:
                self.highest, self._sequence = token, -1
                self._waiting.clear()
                self._leads = True

    def step(self, now_ns: int, dt: float, own: Floats, out: Floats) -> int:
        """Write to ``out`` : (P,) the values shown ``dt`` s after the last step; ``own`` : (P,) the own layers.

        Returns the time of the newest command in the conductor's face, by the local clock (ns); 0 for none.
        """
        newest, now_s = self._due(now_ns), now_ns * 1e-9
        leads, self._leads = self._leads, False
        self._passed_s, self._theirs_s = 0.0 if self.conducted else dt, 0.0
        if newest is not None:
            self._heard_s = now_s
            self._turn_to(*newest, dt)
        elif self.conducted and (leads or self._is_lost(now_s)):
            self.conducted, self._passed_s = False, dt
            self._pass_to(own)
        elif self.conducted:
            self._bridge(now_ns + self.offset_ns - self._delay_ns)
        elif not self._begun:
            self._pass_to(own, first=True)
        self._begun = True
        self._show(self._followed if self.conducted else own, self._time_s(dt), out)
        header = self.header
        return 0 if not self.conducted or header is None or not header.stamp_ns else header.stamp_ns - self.offset_ns

    def _turn_to(self, header: Header, face: Floats, dt: float) -> None:
        """Follow a face of a conductor; if the source changes with it, begin a transition."""
        before, self.header, self._sent = self.header, header, face
        if self.conducted and before is not None and before.token == header.token:
            self._passed_s = 1e-9 * (header.time_ns - self._followed_ns)
            self._theirs_s = self._passed_s if self._followed_ns == before.time_ns else 0.0
        else:
            self._passed_s = dt
            self._pass_to(face, first=not self._begun)
            self.conducted = True
        self._followed, self._followed_ns = face, header.time_ns

    def _bridge(self, time_ns: int) -> None:
        """If faces were lost and a later one waits, interpolate linearly to it, until ``time_ns``."""
        before = self.header
        with self._lock:
            following = self._waiting[0] if self._waiting else None
        if following is None or before is None or following[0].token != before.token:
            return
        steps, span_ns = following[0].sequence - before.sequence, following[0].time_ns - before.time_ns
        passed_ns = min(max(time_ns - before.time_ns, 0), span_ns)  # the next one may have come just now, and late
        fraction = passed_ns * steps // max(span_ns, 1) / steps  # only at the times at which the lost faces were due
        lost_ns = before.time_ns + round(fraction * span_ns)
        if lost_ns > self._followed_ns:
            self._passed_s = 1e-9 * (lost_ns - self._followed_ns)
            self._followed, self._followed_ns = self._sent + fraction * (following[1] - self._sent), lost_ns

    def _time_s(self, dt: float) -> float:
        """Return how far motion advances in a step of ``dt`` s: if they are similar, by the conductor's step length."""
        theirs_s = self._theirs_s
        tolerance_s = min(_STEP_TOLERANCE_S, _STEP_TOLERANCE_FRACTION * max(theirs_s, dt))
        return theirs_s if theirs_s > 0.0 and abs(theirs_s - dt) < tolerance_s else dt

    def _due(self, now_ns: int) -> tuple[Header, Floats] | None:
        """Remove the faces that are due from the queue, and return the newest of them, or None."""
        found = None
        with self._lock:
            while self._waiting:
                if self._delay_ns and self._waiting[0][0].time_ns + self._delay_ns > now_ns + self.offset_ns:
                    break
                found = self._waiting.popleft()
        return found

    def _pass_to(self, source: Floats, *, first: bool = False) -> None:
        """Begin a transition to another source; the gap to it closes along a minimum-jerk curve."""
        if first:
            self._shown[:] = source
            self._way.begin(source)
        self._gap = self._shown - source
        size = np.abs(self._gap)
        by_speed_s = _PEAK_SPEED * size / (_LIMIT_FRACTION * self._p.max_speed)
        by_acceleration_s = np.sqrt(_PEAK_ACCELERATION * size / (_LIMIT_FRACTION * self._p.max_acceleration))
        longest_s = max(_MIN_TRANSITION_S, float(by_speed_s.max()), float(by_acceleration_s.max()))
        self._whole_s = 0.0 if first else longest_s
        self._blended_s = 0.0
        self._way.follow(self._shown)

    def _left(self) -> float:
        """Return the fraction of the gap that is still open, 1 to 0."""
        return 1.0 - minimum_jerk(self._blended_s / self._whole_s) if self._whole_s > 0.0 else 0.0

    def _show(self, source: Floats, time_s: float, out: Floats) -> None:
        """Write to ``out`` the blend of both sources within the limits; after the transition it can be exact."""
        self._blended_s += time_s
        left = self._left()
        face = source if left == 0.0 else source + left * self._gap
        self._way.step(time_s, face, out, stay=left == 0.0, passed_s=self._passed_s)
        is_bridge = self.conducted and self._followed is not self._sent
        self.exact = left == 0.0 and bool(self._way.met.all()) and not is_bridge
        self._shown[:] = out
