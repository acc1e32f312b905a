"""What a link may ask of a face, and of the heads beside it: the interfaces between links and layers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from controller.base.parameters import Flags, Floats, Parameters
from controller.base.placement import Placement
from controller.base.stop_latch import StopLatch
from controller.vocabulary.vocabulary import Vocabulary

StatusValue = str | int | float


class Player(Protocol):
    """Plays shows on the clock of the control loop; see :class:`controller.links.line.show.Shows`."""

    def start(self, name: str) -> None:
        """Play a script from its beginning. Raises ConfigError."""

    def prepared(self, name: str) -> Callable[[], None]:
        """What :meth:`start` does, after all that can be refused. Raises ConfigError."""

    def names(self) -> Sequence[str]:
        """The scripts that can be played, by name."""

    def control(self, what: str, to: str | float = 0.0) -> None:
        """``PLAY``, ``PAUSE``, ``STOP`` or ``SEEK``, to a mark or a time (s). Raises ParameterError."""

    def prepared_control(self, what: str, to: str | float = 0.0) -> Callable[[], None]:
        """What :meth:`control` does, after all that can be refused. Raises ParameterError."""

    def tick(self, now_ns: int) -> None:
        """Send the lines that are due."""

    @property
    def name(self) -> str | None:
        """Of the show that was started last; None where there is none."""

    def abandon(self, now_ns: int) -> None:
        """End a show that failed, and give back what it moves."""

    def status(self) -> str:
        """Which show plays and where it is, in one word."""


class TurnTaking(Protocol):
    """Who speaks; see :class:`controller.layers.heads.Turns`."""

    speaker: str | None

    def give(self, name: str | None, stamp_ns: int) -> None:
        """Give the turn to a head; None: to nobody. Raises ParameterError: no head is called so."""


class Directory(Protocol):
    """The heads of a run by name; see :class:`controller.layers.heads.Heads`.

    turns : who speaks; None where there is one head.
    """

    @property
    def turns(self) -> TurnTaking | None:
        """Who speaks; None where there is one head."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the heads, in the order of the stage; none where there is one head."""

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups."""

    def find(self, name: str) -> CommandSink:
        """Whom a name means: a head, a group, or all. Raises ParameterError: nobody."""

    def head(self, name: str) -> HeadSink:
        """The one head of a name. Raises ParameterError: no head is called so."""


class CommandSink(Protocol):
    """What a link may ask of the face. ``stamp_ns`` is when the command arrived (monotonic clock, ns).

    vocabulary : the named expressions.
    stop_latch : set by STOP, released by START. heads : every head of the run by name, this one among them.
    """

    stop_latch: StopLatch
    parameters: Parameters
    vocabulary: Vocabulary
    heads: Directory

    @property
    def shows(self) -> Player | None:
        """Plays scripts; None where none can be."""

    def set_parameters(self, indices: Sequence[int], values: Sequence[float], stamp_ns: int) -> None:
        """Hold parameters at values, until released."""

    def release(self, indices: Sequence[int], stamp_ns: int) -> None:
        """Give held parameters back to the layers below."""

    def write_layer(self, name: str, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0) -> None:
        """Give a layer ``values`` : (P,) where ``mask`` : (P,) bool, and release the rest."""

    def release_layer(self, name: str) -> None:
        """Let a layer fade out, whose source is lost."""

    def expression(self, name: str, intensity: float, duration_s: float | None, stamp_ns: int) -> None:
        """Show a named expression; without a duration until the next one."""

    def gaze(self, yaw_rad: float, pitch_rad: float, stamp_ns: int) -> None:
        """Look in a direction."""

    def gaze_at(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        """Look at a point."""

    def gaze_room(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        """Look at a point of the room, from where the head stands."""

    def gaze_head(self, name: str, stamp_ns: int) -> None:
        """Look at another head of the stage. Raises ParameterError: no other head is called so."""

    def gaze_off(self, stamp_ns: int) -> None:
        """Stop looking at anything."""

    def neutral(self, seconds: float, stamp_ns: int) -> None:
        """Release everything that was commanded and return to neutral."""

    def live(self, amount: float, stamp_ns: int, manner: str | None = None) -> None:
        """Set the amount of idle motion, 0..1, and how the face behaves; the present manner without.

        ``manner`` : one of :data:`controller.layers.idle.settings.MANNERS`, or ``auto``.
        """

    def viseme(self, names: Sequence[str], weights: Sequence[float], stamp_ns: int) -> None:
        """Form the mouth of visemes, each at its weight 0..1, until the next ones; released after a second without."""

    def snapshot(self, out: Floats) -> None:
        """Copy the present parameters to ``out`` : (P,)."""

    def measured(self, out: Floats) -> bool:
        """Copy the parameters that the servos show to ``out`` : (P,); False when no servo reports its position."""

    def holder(self, index: int) -> str | None:
        """The layer that holds a parameter."""

    def layer_names(self) -> tuple[str, ...]:
        """Layers, lowest priority first."""

    def status(self) -> dict[str, StatusValue]:
        """The state of the face, as short words and numbers."""

    def overview(self) -> Mapping[str, list[dict[str, Any]]]:
        """``servos`` and ``links``, one record each; see :mod:`controller.robot.servo_states` and Link.report."""

    def held(self) -> dict[int, float]:
        """The parameters that were set and not released, by index."""


class HeadSink(CommandSink, Protocol):
    """One head, as the others see it. placement : where it stands."""

    name: str
    placement: Placement

    @property
    def liveliness(self) -> float:
        """The amount of idle motion, 0..1."""

    @property
    def manner(self) -> str:
        """How the face was commanded to behave: a manner, or ``auto``."""

    @property
    def loudness(self) -> float:
        """How loud the face speaks, 0..1."""
