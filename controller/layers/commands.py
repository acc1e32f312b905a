"""Applies commands to the face: layers, expressions, gaze and idle motion behind the interface that links call.

Links call the methods of :class:`CommandSink` from their own threads; the control loop calls
:meth:`CommandState.tick`. One lock, which each call holds only briefly, keeps them apart.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from controller.base.errors import ParameterError
from controller.base.mailboxes import Life
from controller.base.parameters import Flags, Floats, Parameters
from controller.base.parts import Parts
from controller.base.placement import Placement
from controller.base.stop_latch import StopLatch
from controller.layers.heads import Heads
from controller.layers.idle.settings import AUTO, IdleSettings, check_manner
from controller.layers.mixer import LayerSettings, Mixer
from controller.layers.settings import default_layers
from controller.layers.sink import CommandSink, Directory, Player, StatusValue
from controller.layers.sources import Sources, require_finite
from controller.motion.motion import MotionLimiter
from controller.vocabulary.visemes import Visemes
from controller.vocabulary.vocabulary import Vocabulary

__all__ = ["CommandSink", "CommandState", "Journal", "Player", "ServoMonitor", "StatusValue"]

Journal = Callable[..., None]
"""Receives the name and the arguments of each call, in the order in which the calls took effect."""


class ServoMonitor(Protocol):
    """Measures the servos; see :class:`controller.robot.following.MeasuredFace`."""

    def measured(self, out: Floats) -> bool:
        """Copy the parameters that the servos show to ``out`` : (P,); return False if none is known."""

    def status(self) -> Mapping[str, StatusValue]:
        """Return the state of the servos, as short words and numbers."""


class CommandState:
    """The :class:`CommandSink` of a face: its layers, mixed, limited and clipped once per tick.

    Parameters
    ----------
    vocabulary : the named expressions. Default: the shipped ones.
    layers : must include those of :data:`controller.layers.settings.NEEDED`. Default: the shipped ones.
    life : settings of idle motion. Default: ``natural``. seed : the same seed gives the same idle motion.
    period_s : length of a tick.

    Attributes
    ----------
    link_status : returns the state of the links, for STATUS.
    servo_records, link_records : return every servo and link, for :meth:`overview`.
    servo_monitor : measures the servos; None without servos. shows : the player of scripts; None if there is none.
    on_command : called after each command, in the thread that gave it. on_event : like a journal, but without ticks.
    parts : registers what can fail alone; the layer of a source that failed fades out, and the source begins again.
    stop_latch : keeps the servos off from STOP to START; several heads share one.
    name : of the head; empty if the stage has one head. heads : all heads by name. placement : its place in the room.

    Raises ConfigError: the shipped expressions or figures cannot be read.
    """

    def __init__(
        self,
        parameters: Parameters,
        vocabulary: Vocabulary | None = None,
        layers: Sequence[LayerSettings] | None = None,
        *,
        life: IdleSettings | None = None,
        seed: int = 0,
        period_s: float = 0.01,
    ) -> None:
        self.parameters = parameters
        self.vocabulary = vocabulary or Vocabulary.load(parameters)
        self.mixer = Mixer(parameters, default_layers() if layers is None else layers)
        self.limiter = MotionLimiter.of(parameters, period_s)
        self.limiter.reset(parameters.rest)
        self.parts = Parts()
        self._mixed, self._present = parameters.neutral(), parameters.neutral()
        self._manual = self.mixer["manual"]
        self._sources = Sources(
            self.mixer,
            self._present,
            parameters=parameters,
            vocabulary=self.vocabulary,
            life=life or IdleSettings.named("natural", parameters),
            seed=seed,
            parts=self.parts,
        )
        self.servo_monitor: ServoMonitor | None = None
        self.link_status: Callable[[], Mapping[str, StatusValue]] = dict
        self.servo_records: Callable[[], list[dict[str, Any]]] = list
        self.link_records: Callable[[], list[dict[str, Any]]] = list
        self.shows: Player | None = None
        self.on_command: Callable[[], None] = _nothing
        self.stop_latch = StopLatch()
        self.name, self.placement = "", Placement()
        self.heads: Directory = Heads()
        self._lock = threading.Lock()
        self._journal: Journal | None = None
        self.on_event: Journal | None = None
        self._stamp_ns = 0
        self._now_s = 0.0
        self._ticks = 0

    def tick(self, now_ns: int, dt: float, out: Floats) -> int:
        """Advance to ``now_ns`` (monotonic clock), ``dt`` seconds after the last tick.

        Writes the parameters to ``out`` : (P,) and returns the arrival time (ns) of the newest command that they
        include; 0 before the first command.
        """
        with self._journaled("tick", now_ns, dt, out):
            now_s = self._now_s = now_ns * 1e-9
            self._sources.write(now_s)
            self.mixer.mix(now_s, dt, self._mixed)
            self.limiter.step(dt, self._mixed, self._present)
            self._ticks += 1
            out[:] = self._present
            return self._stamp_ns

    def show(self, values: Floats) -> None:
        """Set the current parameters to ``values`` : (P,), which another process computed."""
        with self._lock:
            self._present[:] = values

    def record(self, journal: Journal | None) -> None:
        """Call ``journal`` for every tick and every command from now on; None ends it."""
        with self._lock:
            self._journal = journal

    @contextmanager
    def _journaled(self, name: str, *arguments: Any, stamp_ns: int = 0) -> Iterator[None]:
        """Hold the lock; afterwards record the arrival of the command, and pass it to the journal and listeners."""
        with self._lock:
            yield
            self._stamp_ns = max(self._stamp_ns, stamp_ns)
            if self._journal is not None:
                self._journal(name, *arguments)
        if self.on_event is not None and name != "tick":
            self.on_event(name, *arguments)
        if stamp_ns:
            self.on_command()

    @property
    def gaze_rad(self) -> tuple[float, float] | None:
        """Yaw and pitch of the commanded gaze; None without one."""
        gaze = self._sources.gaze
        yaw, pitch = gaze.direction_deg
        return (math.radians(yaw), math.radians(pitch)) if gaze.active else None

    @property
    def beside(self) -> Life:
        """Breath and pupils, which pictures show beside the parameters."""
        return self._sources.beside.now

    @property
    def liveliness(self) -> float:
        """The amount of idle motion, 0..1."""
        return self._sources.life.liveliness

    @property
    def manner(self) -> str:
        """How the face was commanded to behave: a manner, or ``auto``."""
        return self._sources.life.chosen or AUTO

    @property
    def loudness(self) -> float:
        """How loud the face speaks, 0..1: the jaw opening of the speech layer; 0 without speech."""
        return self._sources.loudness

    def set_parameters(self, indices: Sequence[int], values: Sequence[float], stamp_ns: int) -> None:
        with self._journaled("set_parameters", indices, values, stamp_ns, stamp_ns=stamp_ns):
            self._manual.write(list(indices), values, stamp_ns * 1e-9)

    def release(self, indices: Sequence[int], stamp_ns: int) -> None:
        with self._journaled("release", indices, stamp_ns, stamp_ns=stamp_ns):
            self._manual.release(list(indices))

    def expression(self, name: str, intensity: float, duration_s: float | None, stamp_ns: int) -> None:
        expression = self.vocabulary[name]
        _check_finite("EXPR", intensity, duration_s or 0.0)
        with self._journaled("expression", name, intensity, duration_s, stamp_ns, stamp_ns=stamp_ns):
            self._sources.player.play(expression, intensity, duration_s, self._time(stamp_ns))

    def gaze(self, yaw_rad: float, pitch_rad: float, stamp_ns: int) -> None:
        _check_finite("GAZE", yaw_rad, pitch_rad)
        with self._journaled("gaze", yaw_rad, pitch_rad, stamp_ns, stamp_ns=stamp_ns):
            self._sources.gaze.look(yaw_rad, pitch_rad)
            self._sources.life.shift(self._sources.gaze.shift_rad, self._time(stamp_ns))

    def gaze_at(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        _check_finite("GAZE AT", x_mm, y_mm, z_mm)
        with self._journaled("gaze_at", x_mm, y_mm, z_mm, stamp_ns, stamp_ns=stamp_ns):
            self._sources.gaze.look_at(x_mm, y_mm, z_mm)
            self._sources.life.shift(self._sources.gaze.shift_rad, self._time(stamp_ns))

    def gaze_room(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        _check_finite("GAZE ROOM", x_mm, y_mm, z_mm)
        self.gaze_at(*self.placement.to_head((x_mm, y_mm, z_mm)), stamp_ns)

    def gaze_head(self, name: str, stamp_ns: int) -> None:
        other = self.heads.head(name)
        if other is self:
            raise ParameterError(f"{name} cannot look at itself", hint="name another head")
        self.gaze_room(*other.placement.position_mm, stamp_ns)

    def gaze_off(self, stamp_ns: int) -> None:
        with self._journaled("gaze_off", stamp_ns, stamp_ns=stamp_ns):
            self._sources.stop_looking()

    def neutral(self, seconds: float, stamp_ns: int) -> None:
        _check_finite("NEUTRAL", seconds)
        with self._journaled("neutral", seconds, stamp_ns, stamp_ns=stamp_ns):
            self._manual.release(fade_s=seconds)
            self._sources.stop_looking(seconds)
            self._sources.player.rest(seconds, self._time(stamp_ns))

    def live(self, amount: float, stamp_ns: int, manner: str | None = None) -> None:
        _check_finite("LIFE", amount)
        known = check_manner(manner)
        given = (amount, stamp_ns) if manner is None else (amount, stamp_ns, manner)
        with self._journaled("live", *given, stamp_ns=stamp_ns):
            self._sources.life.liveliness = min(max(amount, 0.0), 1.0)
            if manner is not None:
                self._sources.life.chosen = known

    def viseme(self, names: Sequence[str], weights: Sequence[float], stamp_ns: int) -> None:
        _check_finite("VISEME", *weights)
        visemes = self._visemes
        mixed = sum((weight * visemes.weights(name) for name, weight in zip(names, weights, strict=True)),
                    np.zeros(len(visemes.names)))  # fmt: skip
        values = np.clip(visemes.matrix @ mixed, 0.0, 1.0)
        self.write_layer("speech", values, visemes.mask, stamp_ns, stamp_ns, through=visemes.through)

    @cached_property
    def _visemes(self) -> Visemes:
        return Visemes.load(self.parameters)

    def capture(self, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0) -> None:
        """Write the capture layer, which is released when nothing comes any more; see :meth:`write_layer`."""
        self.write_layer("capture", values, mask, now_ns, stamp_ns)

    def write_layer(
        self, name: str, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0, *, through: Floats | None = None
    ) -> None:
        """Set the values of a layer to ``values`` : (P,) where ``mask`` : (P,) is True, and release the others.

        through : (P,) weight 0..1 with which the layers below show through; None for 0.

        Raises KeyError: no layer has this name. ParameterError: not all values are finite; nothing changes then.
        """
        require_finite(values[mask] if through is None else np.concatenate([values[mask], through]))
        with self._journaled("write_layer", name, values, mask, now_ns, stamp_ns, through, stamp_ns=stamp_ns):
            layer = self.mixer[name]
            layer.write_masked(values, mask, now_ns * 1e-9)
            if through is None:
                layer.share.fill(1.0)
            else:
                np.subtract(1.0, through, out=layer.share)

    def release_layer(self, name: str) -> None:
        """Fade out a layer whose source has failed. Raises KeyError: no layer has this name."""
        with self._lock:
            self.mixer[name].release()

    def snapshot(self, out: Floats) -> None:
        with self._lock:
            out[:] = self._present

    def measured(self, out: Floats) -> bool:
        return self.servo_monitor is not None and self.servo_monitor.measured(out)

    def holder(self, index: int) -> str | None:
        with self._lock:
            return self.mixer.holder(index)

    def layer_names(self) -> tuple[str, ...]:
        return self.mixer.names

    def status(self) -> dict[str, StatusValue]:
        with self._lock:
            yaw, pitch = self._sources.gaze.direction_deg
            return {
                **self._head_status(),
                "expression": self._sources.player.name,
                "intensity": round(self._sources.player.intensity, 3),
                "gaze": f"{yaw:.1f},{pitch:.1f}" if self._sources.gaze.active else "off",
                "life": self._sources.life.liveliness,
                "manner": self._sources.life.manner,
                "manual": self._manual.holding,
                "capture": self.mixer["capture"].holding,
                "limited": int(np.count_nonzero(self.limiter.limited)),
                "ticks": self._ticks,
                "layers": ",".join(self.mixer.active) or "none",
                "failed": ",".join(self.parts.failed).replace(" ", "_") or "none",
                **(self.servo_monitor.status() if self.servo_monitor is not None else {}),
                **self.link_status(),
            }

    def _head_status(self) -> dict[str, StatusValue]:
        """Return the name of this head and of the one that has the turn, if there are several heads."""
        if not self.name:
            return {}
        turns = self.heads.turns
        return {"head": self.name, "turn": (turns.speaker if turns is not None else None) or "none"}

    def overview(self) -> Mapping[str, list[dict[str, Any]]]:
        return {"servos": self.servo_records(), "links": self.link_records()}

    def held(self) -> dict[int, float]:
        with self._lock:
            manual = self._manual
            return {int(i): float(manual.values[i]) for i in np.flatnonzero(manual.held)}

    def _time(self, stamp_ns: int) -> float:
        """Return when a command takes effect (s): at its arrival, but not before the last tick."""
        return max(stamp_ns * 1e-9, self._now_s)


def _nothing() -> None:
    """Do nothing; the default of ``on_command``."""


def _check_finite(what: str, *numbers: float) -> None:
    """Raise ParameterError for a command with a number that is not finite."""
    if not all(map(math.isfinite, numbers)):
        raise ParameterError(f"{what}: needs finite numbers")
