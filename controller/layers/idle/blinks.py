"""Generates blinks: complete and partial ones, single and double ones, slightly different on both sides."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from controller.layers.idle.draws import draw
from controller.layers.idle.settings import BlinkSettings
from controller.motion.motion import Envelope

_MIN_GAP_S = 0.3
"""Shortest time from the end of a blink to a blink with an external cause."""


@dataclass(frozen=True)
class Blink:
    """One blink.

    lids : motion of the left and the right lid. amounts : how far each closes, 0..1. rank : random number 0..1; the
    blink shows only if the liveliness is above it.
    """

    lids: tuple[Envelope, Envelope]
    amounts: tuple[float, float]
    rank: float

    @property
    def end_s(self) -> float:
        """Time at which both lids are open again."""
        return max(lid.end_s for lid in self.lids)


class Blinks:
    """The blinks of one face.

    blinks : current and coming blinks. next_s : time of the next spontaneous blink.
    """

    def __init__(self, settings: BlinkSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self._weaker = numbers.randrange(2)  # the side that closes later and less, always the same one
        self.blinks: list[Blink] = []
        self.next_s, self._free_s = math.inf, -math.inf

    def begin(self, now_s: float, rate: float = 1.0) -> None:
        """Start with open lids; ``rate`` : factor on the blink rate."""
        self.blinks, self._free_s = [], -math.inf
        self.next_s = now_s + self._interval(rate)

    def advance(self, now_s: float, rate: float = 1.0) -> None:
        """Start the blinks that are due until ``now_s``."""
        while self.next_s <= now_s:
            self._start_blink(self.next_s)
            end_s = self.blinks[-1].end_s
            self.next_s, self._free_s = end_s + self._interval(rate), end_s + _MIN_GAP_S
        if self.blinks and self.blinks[-1].end_s < now_s:
            self.blinks = []

    def request(self, now_s: float) -> None:
        """Blink at ``now_s``, unless a blink is going on, has just ended or is due before."""
        if now_s >= self._free_s:
            self.next_s = min(self.next_s, now_s)

    def shift(self, angle_rad: float, now_s: float) -> None:
        """React to a jump of the gaze by an angle: a large jump may cause a blink (Evinger et al. 1994)."""
        large = math.degrees(abs(angle_rad)) >= self._settings.shift_deg
        if large and self._random.random() < self._settings.shift_share:
            self.request(now_s)

    def levels(self, now_s: float, liveliness: float = 1.0) -> tuple[float, float]:
        """Return how far the left and the right lid are closed, 0..1; liveliness changes how often, not how far."""
        left = right = 0.0
        for blink in self.blinks:
            if blink.rank < liveliness:
                left = max(left, blink.amounts[0] * blink.lids[0].level(now_s))
                right = max(right, blink.amounts[1] * blink.lids[1].level(now_s))
        return left, right

    def _interval(self, rate: float) -> float:
        return draw(self._settings.interval_s, self._random) / rate

    def _start_blink(self, start_s: float) -> None:
        self.blinks.append(self._draw_blink(start_s))
        if self._random.random() < self._settings.double_share:
            self.blinks.append(
                self._draw_blink(self.blinks[-1].end_s + draw(self._settings.double_gap_s, self._random))
            )

    def _draw_blink(self, start_s: float) -> Blink:
        """Return a random blink; a partial one lasts as long, so it is slower (main sequence, Evinger 1991)."""
        settings, numbers = self._settings, self._random
        lag_s, hold_s = numbers.uniform(0.0, settings.lag_s), draw(settings.hold_s, numbers)
        partial = numbers.random() < settings.partial_share
        amount = numbers.uniform(*settings.partial_amount) if partial else 1.0
        less = numbers.uniform(0.0, settings.uneven_share) if partial else 0.0
        first = Envelope(start_s, settings.close_s, hold_s, settings.open_s)
        later = Envelope(start_s + lag_s, settings.close_s, hold_s, settings.open_s)
        lids, amounts = (first, later), (amount, amount * (1.0 - less))
        if self._weaker == 0:
            lids, amounts = (later, first), (amounts[1], amounts[0])
        return Blink(lids, amounts, numbers.random())
