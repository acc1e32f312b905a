"""Defines the interfaces between links and layers: the commands and queries of a face and of the heads of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from controller.base.mailboxes import Life
from controller.base.parameters import Flags, Floats, Parameters
from controller.base.placement import Placement
from controller.base.stop_latch import StopLatch
from controller.vocabulary.vocabulary import Vocabulary

StatusValue = str | int | float


class Player(Protocol):
    """Plays shows on the clock of the control loop; see :class:`controller.links.line.show.Shows`."""

    def start(self, name: str) -> None:
        """Play a script from its beginning. Raises ConfigError."""

    def prepare_start(self, name: str) -> Callable[[], None]:
        """Check everything that :meth:`start` may refuse, and return a function that starts. Raises ConfigError."""

    def names(self) -> Sequence[str]:
        """Return the names of the scripts that can be played."""

    def control(self, what: str, to: str | float = 0.0) -> None:
        """Apply ``PLAY``, ``PAUSE``, ``STOP`` or ``SEEK``; ``to`` : a mark or a time (s). Raises ParameterError."""

    def prepare_control(self, what: str, to: str | float = 0.0) -> Callable[[], None]:
        """Check everything that :meth:`control` may refuse, and return a function that applies it.

        Raises ParameterError.
        """

    def tick(self, now_ns: int) -> None:
        """Send the lines that are due."""

    @property
    def name(self) -> str | None:
        """Name of the show that was started last; None if there is none."""

    def abandon(self, now_ns: int) -> None:
        """End a show that failed, and release what it moves."""

    def status(self) -> str:
        """Return which show plays, and its position, in one word."""


class TurnTaking(Protocol):
    """Who speaks; see :class:`controller.layers.heads.Turns`."""

    speaker: str | None

    def give(self, name: str | None, stamp_ns: int) -> None:
        """Give the turn to a head; None: to nobody. Raises ParameterError: no head has this name."""


class Directory(Protocol):
    """The heads of a run by name; see :class:`controller.layers.heads.Heads`."""

    @property
    def turns(self) -> TurnTaking | None:
        """Who speaks; None where there is one head."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the heads, in the order of the stage file; empty if there is one head without a name."""

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups."""

    def find(self, name: str) -> CommandSink:
        """Return the head or the group of a name, or all heads. Raises ParameterError: unknown name."""

    def head(self, name: str) -> HeadSink:
        """Return the head of a name. Raises ParameterError: no head has this name."""


class CommandSink(Protocol):
    """The commands and queries of a face. ``stamp_ns`` is the time at which a command arrived (monotonic clock, ns).

    vocabulary : the named expressions. stop_latch : set by STOP, released by START.
    heads : every head of the run by name, including this one.
    """

    stop_latch: StopLatch
    parameters: Parameters
    vocabulary: Vocabulary
    heads: Directory

    @property
    def shows(self) -> Player | None:
        """The player of scripts; None if there is none."""

    @property
    def beside(self) -> Life:
        """Breath and pupils, which pictures show beside the parameters."""

    def set_parameters(self, indices: Sequence[int], values: Sequence[float], stamp_ns: int) -> None:
        """Hold parameters at values, until released."""

    def release(self, indices: Sequence[int], stamp_ns: int) -> None:
        """Release held parameters to the layers below."""

    def write_layer(self, name: str, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0) -> None:
        """Set the values of a layer to ``values`` : (P,) where ``mask`` : (P,) is True, and release the others."""

    def release_layer(self, name: str) -> None:
        """Fade out a layer whose source is lost."""

    def expression(self, name: str, intensity: float, duration_s: float | None, stamp_ns: int) -> None:
        """Show a named expression; ``duration_s`` None: until the next one."""

    def gaze(self, yaw_rad: float, pitch_rad: float, stamp_ns: int) -> None:
        """Look in a direction."""

    def gaze_at(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        """Look at a point."""

    def gaze_room(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        """Look at a point in the coordinates of the room, by the placement of the head."""

    def gaze_head(self, name: str, stamp_ns: int) -> None:
        """Look at another head of the stage. Raises ParameterError: no other head has this name."""

    def gaze_off(self, stamp_ns: int) -> None:
        """Stop looking at anything."""

    def neutral(self, seconds: float, stamp_ns: int) -> None:
        """Release everything that was commanded, and return to neutral over ``seconds``."""

    def live(self, amount: float, stamp_ns: int, manner: str | None = None) -> None:
        """Set the amount of idle motion, 0..1, and the manner in which the face behaves.

        manner : one of :data:`controller.layers.idle.settings.MANNERS`, or ``auto``; None keeps the current one.
        """

    def viseme(self, names: Sequence[str], weights: Sequence[float], stamp_ns: int) -> None:
        """Form the mouth of visemes, each with a weight 0..1; released after a second without the next ones."""

    def snapshot(self, out: Floats) -> None:
        """Copy the current parameters to ``out`` : (P,)."""

    def measured(self, out: Floats) -> bool:
        """Copy the parameters that the servos show to ``out`` : (P,); return False if no servo reports its position."""

    def holder(self, index: int) -> str | None:
        """Return the name of the layer that holds a parameter; None if none does."""

    def layer_names(self) -> tuple[str, ...]:
        """Return the names of the layers, lowest priority first."""

    def status(self) -> dict[str, StatusValue]:
        """Return the state of the face, as short words and numbers."""

    def overview(self) -> Mapping[str, list[dict[str, Any]]]:
        """Return a record for each of ``servos`` and ``links``: :mod:`controller.robot.servo_states`, Link.report."""

    def held(self) -> dict[int, float]:
        """Return the values of the parameters that were set and not released, by index."""


class HeadSink(CommandSink, Protocol):
    """One head, with what other heads need to know of it. placement : its position and direction in the room."""

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
