"""Messages between the main process and the body's process: pickled records that are sent over a pipe."""

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
        """Its link. Raises pydantic.ValidationError: ``listen`` is no address."""
        return read_link({"kind": "web", "listen": self.listen, "face": str(self.face), "open_to_network": True})


@dataclass(frozen=True)
class RunOptions:
    """Options of a run besides its stage.

    take : a take or recording to play instead of the links. voice : a voice that moves the mouth.
    mirror : leave the servos' torque off; the face follows a head that is moved by hand.
    record : file for every command and tick. web : a web panel. show : a script to play instead of the stage's show.
    events : file for the lines and marks of shows. lsl : send those marks as LSL markers.
    role, heads : replace those of the stage's ``[zenoh]``.
    standard_input : a link listens there: the body gets what comes in at main's.
    vocabularies : files that the stage has behind its own ones. at_rest : only the panel moves the face.
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
        """The stage as this run has it. Raises ConfigError."""
        stage = for_role(load_stage(name, PARAMETERS, self.vocabularies), self.role, self.heads)
        return at_rest(stage) if self.at_rest else stage


@dataclass(frozen=True)
class BodyOrders:
    """Main to body, first: the stage's file and options. The mailboxes for parameters and panel state follow it, two
    for each head."""

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
    """Main to body, from the panel: hold parameter ``index`` at a value; None releases it to the layers below."""

    index: int
    value: float | None


@dataclass(frozen=True)
class HoldAll:
    """Main to body, from the panel: hold several parameters at once; without values release them."""

    indices: tuple[int, ...]
    values: tuple[float, ...] | None


@dataclass(frozen=True)
class Show:
    """Main to body, from the panel: show a named expression at an intensity 0..1."""

    name: str
    intensity: float


@dataclass(frozen=True)
class LookAt:
    """Main to body, from the panel: look at a point (mm; x to the subject's left, y up, z forward from the middle
    between the eyes); None looks at nothing in particular."""

    point: tuple[float, float, float] | None


@dataclass(frozen=True)
class Live:
    """Main to body, from the panel: the amount of idle motion, 0..1, and the manner; the present one without."""

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
    """Main to body, from the panel: know a named expression of weights (P,) from now on, on every link."""

    name: str
    weights: tuple[float, ...]
    kind: str = "user"


@dataclass(frozen=True)
class Neutral:
    """Main to body, from the panel: release everything and return to neutral over ``seconds``."""

    seconds: float


@dataclass(frozen=True)
class StopServos:
    """Main to body, from the panel: servos off until :class:`StartServos`, whatever else is commanded."""


@dataclass(frozen=True)
class StartServos:
    """Main to body, from the panel: let the servos move again."""


@dataclass(frozen=True)
class Jog:
    """Main to body, from the panel: turn one servo to an angle, within its limits, whatever the face wants; None gives
    it back to the face, as :class:`Neutral` does with all. Servos that are stopped stay off."""

    bus: str
    servo: str
    angle_deg: float | None


@dataclass(frozen=True)
class AskDetails:
    """Main to body, from the panel: answer with :class:`Details`. One at a time, so that none pile up."""


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
    """Main to body, from the panel: a request for the head of a name; without this it is for the first one."""

    head: str
    request: PanelRequest


@dataclass(frozen=True)
class Ready:
    """Body to main: the servos are up; the body waits for :class:`Begin`."""


@dataclass(frozen=True)
class Failed:
    """Body to main: it could not start, or gave up; the error's message and hint, and what was measured before."""

    message: str
    hint: str = ""
    measured: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Finished:
    """Body to main: there is nothing left to play."""


@dataclass(frozen=True)
class Details:
    """Body to main: what every servo, link and bus reports now, and the parts that failed.

    servos : see :func:`controller.robot.servo_states.servo_states`. links : a report each, with its ``name``.
    buses : ``name``, ``running``, ``fault``. parts : see :meth:`controller.base.parts.Part.report`.
    notes : warnings and errors since the last one, oldest first.
    """

    servos: list[dict[str, Any]] = field(default_factory=list)
    links: list[dict[str, Any]] = field(default_factory=list)
    buses: list[dict[str, Any]] = field(default_factory=list)
    parts: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Report:
    """Body to main, last: what was measured."""

    content: dict[str, object] = field(default_factory=dict)
