"""What a line of the line protocol can ask for: one record a command."""

from __future__ import annotations

from dataclasses import dataclass

READINGS = ("UNITS", "EMOTION", "VISEMES", "MOOD")
"""What a face can be read as: action units, the nearest emotion, mouth shapes, valence-arousal-dominance."""


@dataclass(frozen=True)
class Hello:
    """Say who you are. ``HELLO``, ``VERSION``."""


@dataclass(frozen=True)
class Ping:
    """Answer with the same words. ``PING [word ...]``."""

    text: str = ""


@dataclass(frozen=True)
class Set:
    """Hold parameters at values. ``SET name value [name value ...]``, ``FRAME v0 ... v58``."""

    indices: tuple[int, ...]
    values: tuple[float, ...]


@dataclass(frozen=True)
class Release:
    """Give parameters held by SET back to the layers below. ``RELEASE name ...``, ``RELEASE ALL``."""

    indices: tuple[int, ...]


@dataclass(frozen=True)
class Expr:
    """Make a named expression. ``EXPR name [intensity [duration_s]]``; None holds it until the next."""

    name: str
    intensity: float = 1.0
    duration_s: float | None = None


@dataclass(frozen=True)
class Gaze:
    """Look in a direction, degrees. ``GAZE yaw pitch``."""

    yaw_deg: float
    pitch_deg: float


@dataclass(frozen=True)
class GazeAt:
    """Look at a point, mm from the middle between the eyes. ``GAZE AT x y z``."""

    x_mm: float
    y_mm: float
    z_mm: float


@dataclass(frozen=True)
class GazeOff:
    """Leave the gaze to the layers below. ``GAZE OFF``."""


@dataclass(frozen=True)
class Neutral:
    """Release SET, EXPR and GAZE and return to neutral. ``NEUTRAL [seconds]``."""

    seconds: float = 0.5


@dataclass(frozen=True)
class Live:
    """Set how lively the face is by itself, 0 to 1. ``LIFE amount``."""

    amount: float


@dataclass(frozen=True)
class Play:
    """Play a script into the face, or go on, wait, stop or go elsewhere in it.

    ``SHOW name``, ``SHOW PLAY``, ``SHOW PAUSE``, ``SHOW STOP``, ``SHOW SEEK mark|seconds``.
    """

    what: str
    to: str = ""


@dataclass(frozen=True)
class Get:
    """Tell parameters. ``GET name ...``, ``GET ALL``."""

    indices: tuple[int, ...]


@dataclass(frozen=True)
class Read:
    """Tell the face in another vocabulary. ``READ UNITS|EMOTION|VISEMES|MOOD [MEASURED]``."""

    what: str
    measured: bool = False


@dataclass(frozen=True)
class Measured:
    """Tell parameters as the servos were measured to show them. ``MEASURED name ...``, ``MEASURED ALL``."""

    indices: tuple[int, ...]


@dataclass(frozen=True)
class Info:
    """Tell about one parameter. ``INFO name``."""

    index: int


@dataclass(frozen=True)
class Status:
    """Tell how omote is. ``STATUS``."""


@dataclass(frozen=True)
class Subscribe:
    """Stream parameters, or what a question tells. ``SUB rate_hz [ALL | name ... | READ ... | MEASURED ...]``."""

    rate_hz: float
    indices: tuple[int, ...] = ()
    question: Read | Measured | None = None


@dataclass(frozen=True)
class Unsubscribe:
    """End the stream. ``UNSUB``."""


@dataclass(frozen=True)
class List:
    """Tell names. ``LIST COMMANDS|EXPRESSIONS|HOLDERS|LAYERS|PARAMETERS``."""

    what: str


Command = (
    Hello | Ping | Set | Release | Expr | Gaze | GazeAt | GazeOff | Neutral | Live | Play
    | Get | Read | Measured | Info | Status | Subscribe | Unsubscribe | List
)  # fmt: skip


@dataclass(frozen=True)
class Request:
    """A command with the tag and the checksum habit of its line."""

    command: Command
    tag: int | None = None
    checked: bool = False
