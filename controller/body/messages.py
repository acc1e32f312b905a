"""Messages between the main process and the control process (body): pickled records that are sent over a pipe."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from controller.base.parameters import PARAMETERS
from controller.body.sources import Voice
from controller.links.links import LinkSettings, read_link
from controller.stage.roles import for_role
from controller.stage.stage import Stage, at_rest, load_stage


@dataclass(frozen=True)
class WebPanel:
    """A web panel beside the links of a stage.

    listen : HOST:PORT. face : the file with the face, which may appear later.
    """

    listen: str
    face: Path

    def link(self) -> LinkSettings:
        """Return the settings of its link. Raises pydantic.ValidationError: ``listen`` is not an address."""
        return read_link({"kind": "web", "listen": self.listen, "face": str(self.face), "open_to_network": True})


@dataclass(frozen=True)
class RunOptions:
    """Options of a run besides its stage.

    take : a take or recording to play instead of the links. voice : a voice that moves the mouth.
    mirror : leave the servos' torque off; the face follows a robot that is moved by hand.
    record : file for every command and tick. web : a web panel. show : a script to play instead of the stage's show.
    events : file for the lines and marks of shows. lsl : send those marks as LSL markers.
    role, heads : replace those of the stage's ``[zenoh]``.
    standard_input : whether a link reads standard input, which the main process then forwards to the body.
    vocabularies : files to add after the stage's own ones. at_rest : run without links, robots and sources, so only the
        panel moves the face.
    """

    take: Path | None = None
    mirror: bool = False
    voice: Voice | None = None
    record: Path | None = None
    web: WebPanel | None = None
    show: Path | None = None
    events: Path | None = None
    lsl: bool = False
    role: str | None = None
    heads: tuple[str, ...] = ()
    standard_input: bool = False
    vocabularies: tuple[Path, ...] = ()
    at_rest: bool = False

    def load_stage(self, name: str) -> Stage:
        """Load a stage and reduce it to what this run needs of it. Raises ConfigError."""
        stage = for_role(load_stage(name, PARAMETERS, self.vocabularies), self.role, self.heads)
        return at_rest(stage) if self.at_rest else stage


@dataclass(frozen=True)
class BodyOrders:
    """Main to body, first: the stage's file and options.

    The mailboxes for parameters and panel state follow it, two for each head.
    """

    stage: str
    options: RunOptions = RunOptions()


@dataclass(frozen=True)
class Begin:
    """Main to body: the face is ready; open the links, or start the take."""


@dataclass(frozen=True)
class Stop:
    """Main to body: stop the servos and end."""


@dataclass(frozen=True)
class Hold:
    """Main to body, from the panel: hold parameter ``index`` at a value; None releases it to lower layers."""

    index: int
    value: float | None


@dataclass(frozen=True)
class HoldAll:
    """Main to body, from the panel: hold several parameters at once; ``values`` None releases them."""

    indices: tuple[int, ...]
    values: tuple[float, ...] | None


@dataclass(frozen=True)
class Show:
    """Main to body, from the panel: show a named expression at an intensity 0..1."""

    name: str
    intensity: float


@dataclass(frozen=True)
class LookAt:
    """Main to body, from the panel: look at a point; None ends a commanded gaze.

    point : mm from the middle between the eyes; x to the subject's left, y up, z forward.
    """

    point: tuple[float, float, float] | None


@dataclass(frozen=True)
class Live:
    """Main to body, from the panel: set the amount of idle motion, 0..1, and its manner; None keeps the manner."""

    amount: float
    manner: str | None = None


@dataclass(frozen=True)
class PlayShow:
    """Main to body, from the panel: play a show from its beginning."""

    name: str


@dataclass(frozen=True)
class ControlShow:
    """Main to body, from the panel: ``PLAY``, ``PAUSE`` or ``STOP`` the show that was started last."""

    what: Literal["PLAY", "PAUSE", "STOP"]


@dataclass(frozen=True)
class Learn:
    """Main to body, from the panel: add a named expression of weights (P,) to the vocabulary of every link."""

    name: str
    weights: tuple[float, ...]
    kind: str = "user"


@dataclass(frozen=True)
class Neutral:
    """Main to body, from the panel: release everything and return to the neutral face within ``seconds``."""

    seconds: float


@dataclass(frozen=True)
class StopServos:
    """Main to body, from the panel: switch the servos off until :class:`StartServos`, whatever else is commanded."""


@dataclass(frozen=True)
class StartServos:
    """Main to body, from the panel: let the servos move again."""


@dataclass(frozen=True)
class Jog:
    """Main to body, from the panel: move one servo to an angle within its limits, independent of the face.

    None lets it follow the face again, as :class:`Neutral` does with all servos. Servos that are stopped stay off.
    """

    bus: str
    servo: str
    angle_deg: float | None


@dataclass(frozen=True)
class AskDetails:
    """Main to body, from the panel: answer with :class:`Details`. Main waits for the answer before it asks again."""


@dataclass(frozen=True)
class PlayTake:
    """Main to body, from the panel: play a take from its beginning, beside the links."""

    path: Path


PanelRequest = (
    Hold
    | HoldAll
    | Show
    | LookAt
    | Live
    | PlayShow
    | ControlShow
    | Learn
    | Neutral
    | StopServos
    | StartServos
    | Jog
    | AskDetails
    | PlayTake
)


@dataclass(frozen=True)
class ToHead:
    """Main to body, from the panel: a request for the head called ``head``; a bare request is for the first head."""

    head: str
    request: PanelRequest


@dataclass(frozen=True)
class Ready:
    """Body to main: the servos are started; the body waits for :class:`Begin`."""


@dataclass(frozen=True)
class Failed:
    """Body to main: the body could not start, or failed; the error's message and hint, and the measurements so far."""

    message: str
    hint: str = ""
    measured: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Finished:
    """Body to main: there is nothing left to play."""


@dataclass(frozen=True)
class Details:
    """Body to main: what every servo, link and bus reports now, and the parts that failed.

    servos : see :func:`controller.robot.servo_states.servo_states`. links : the report of each, with its ``name``.
    buses : ``name``, ``running``, ``fault``. parts : see :meth:`controller.base.parts.Part.report`.
    notes : warnings and errors that were logged since the last answer, oldest first.
    """

    servos: list[dict[str, Any]] = field(default_factory=list)
    links: list[dict[str, Any]] = field(default_factory=list)
    buses: list[dict[str, Any]] = field(default_factory=list)
    parts: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Report:
    """Body to main, last: the measurements of the run."""

    content: dict[str, object] = field(default_factory=dict)
