"""Follows a conductor: shows exactly what it sends, one's own life without it, and no jump between; no I/O here."""

from __future__ import annotations

import threading
from collections import Counter, deque

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.fleet.approach import Approach
from controller.fleet.lease import NOBODY, Token
from controller.fleet.payload import Header
from controller.motion.motion import minimum_jerk

_SHARE = 0.6
"""How much of the limits of speed and acceleration passing from one source to the other may use, beside the motion of
the sources themselves; the limiter behind it holds them in any case."""
_SHORTEST_S = 0.3
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.7735
"""Greatest speed (1/s) and acceleration (1/s²) of the minimum-jerk curve from 0 to 1 over one second."""
_BESIDE_S, _BESIDE_SHARE = 5e-3, 0.45
"""The time of motion is a conductor's where that lies nearer than this to one's own, and nearer than this share of the
longer of both: ticks begin unevenly, but where one is left out, the next is twice as long."""
_WAITING = 128


class Follower:
    """What one head shows of a conductor and of its own life.

    Faces come in by :meth:`take`, from any thread; the control loop calls :meth:`step`.

    Parameters
    ----------
    patience_s : a conductor that is silent for so long is lost. delay_ns : a face is shown so long after it was mixed,
        by the conductor's clock; 0 shows the newest at once.

    Attributes
    ----------
    highest : the highest token obeyed. taken, refused : counts; refused by reason.
    conducted : whether a conductor is followed. exact : whether exactly its faces are shown, or one's own without it.
    header : of the face that is shown. offset_ns : what one's own clock lacks to the conductor's.
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
        self._waiting: deque[tuple[Header, Floats]] = deque(maxlen=_WAITING)
        self._sequence = -1
        self._sent = p.neutral()  # what the conductor sent last
        self._followed, self._followed_ns = self._sent, 0  # that, or what lies between that and the next, and when
        self._shown = p.neutral()
        self._passed_s = 0.0  # in how long what is followed moved since the last step
        self._theirs_s = 0.0  # the same from one face that was sent to the next one; 0 where that is not so
        self._gap, self._blended_s, self._whole_s = np.zeros(len(p)), 0.0, 0.0
        self._heard_s = -np.inf
        self._begun, self._leads = False, False

    def take(self, header: Header, values: Floats) -> bool:
        """Take a face that arrived; False where it is refused: of a conductor that was replaced, or an old one."""
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
        """When what is shown was due by one's own clock; None for what is shown as soon as it comes."""
        if not self._delay_ns or self.header is None or not self.conducted:
            return None
        return self.header.time_ns + self._delay_ns - self.offset_ns

    def follows(self, now_s: float) -> bool:
        """Whether a conductor is followed, and will be at a tick before ``now_s``: one's own life is not used then."""
        return self.conducted and not self._is_lost(now_s)

    def _is_lost(self, now_s: float) -> bool:
        return now_s - self._heard_s > self._patience_s

    def lead(self, token: Token) -> None:
        """Conduct by oneself: nobody with a lower token is followed from now on."""
        with self._lock:
            if token > self.highest:
                self.highest, self._sequence = token, -1
                self._waiting.clear()
                self._leads = True

    def step(self, now_ns: int, dt: float, own: Floats, out: Floats) -> int:
        """Write to ``out`` : (P,) what is shown ``dt`` s after the last step; ``own`` : (P,) is one's own life.

        Returns when the newest command in it came, by one's own clock (ns); 0 for none.
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
        """Show a face from now on, or go on to it."""
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
        """Where faces were lost and the next one waits, follow a straight line to that, as far as ``time_ns``."""
        before = self.header
        with self._lock:
            following = self._waiting[0] if self._waiting else None
        if following is None or before is None or following[0].token != before.token:
            return
        steps, span_ns = following[0].sequence - before.sequence, following[0].time_ns - before.time_ns
        passed_ns = min(max(time_ns - before.time_ns, 0), span_ns)  # the next one may have come just now, and late
        share = passed_ns * steps // max(span_ns, 1) / steps  # when the lost ones were due
        at_ns = before.time_ns + round(share * span_ns)
        if at_ns > self._followed_ns:
            self._passed_s = 1e-9 * (at_ns - self._followed_ns)
            self._followed, self._followed_ns = self._sent + share * (following[1] - self._sent), at_ns

    def _time_s(self, dt: float) -> float:
        """How far motion goes on in a step of ``dt`` s: as far as from one of a conductor's ticks to the next one."""
        theirs_s = self._theirs_s
        beside_s = min(_BESIDE_S, _BESIDE_SHARE * max(theirs_s, dt))
        return theirs_s if theirs_s > 0.0 and abs(theirs_s - dt) < beside_s else dt

    def _due(self, now_ns: int) -> tuple[Header, Floats] | None:
        """The newest face that is to be shown by now."""
        found = None
        with self._lock:
            while self._waiting:
                if self._delay_ns and self._waiting[0][0].time_ns + self._delay_ns > now_ns + self.offset_ns:
                    break
                found = self._waiting.popleft()
        return found

    def _pass_to(self, source: Floats, *, first: bool = False) -> None:
        """Begin to pass to another source: the gap to it closes along a minimum-jerk curve."""
        if first:
            self._shown[:] = source
            self._way.begin(source)
        self._gap = self._shown - source
        size = np.abs(self._gap)
        speed = _PEAK_SPEED * size / (_SHARE * self._p.max_speed)
        acceleration = np.sqrt(_PEAK_ACCELERATION * size / (_SHARE * self._p.max_acceleration))
        self._whole_s = 0.0 if first else max(_SHORTEST_S, float(speed.max()), float(acceleration.max()))
        self._blended_s = 0.0
        self._way.follow(self._shown)

    def _left(self) -> float:
        """How much of the gap is still to be closed, 1 to 0."""
        return 1.0 - minimum_jerk(self._blended_s / self._whole_s) if self._whole_s > 0.0 else 0.0

    def _show(self, source: Floats, time_s: float, out: Floats) -> None:
        """Follow the blend of both sources within the limits; after it, exactly what every parameter has met."""
        self._blended_s += time_s
        left = self._left()
        face = source if left == 0.0 else source + left * self._gap
        self._way.step(time_s, face, out, stay=left == 0.0, passed_s=self._passed_s)
        is_bridge = self.conducted and self._followed is not self._sent
        self.exact = left == 0.0 and bool(self._way.met.all()) and not is_bridge
        self._shown[:] = out
