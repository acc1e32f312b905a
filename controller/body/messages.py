"""What main and body process say to each other, besides the mailboxes: a few pickled records over a pipe."""

from __future__ import annotations

from dataclasses import dataclass, field

from controller.body.sources import Voice


@dataclass(frozen=True)
class BodyOrders:
    """What the body shall do.

    Attributes
    ----------
    stage : path of the stage's file.
    mailbox : path of the mailbox the parameters are published in.
    take : a recorded take to play instead of the links; None for none.
    mirror : leave the servos limp; the face shows where somebody moves them.
    voice : a voice that moves the mouth. record : file to write every command and tick to.
    insight : path of the mailbox for what the panel shows besides; None for none.
    """

    stage: str
    mailbox: str
    take: str | None = None
    mirror: bool = False
    voice: Voice | None = None
    record: str | None = None
    insight: str | None = None


@dataclass(frozen=True)
class Begin:
    """Main to body: the face is there; open the links, or start the take."""


@dataclass(frozen=True)
class Stop:
    """Main to body: stop the servos and end."""


@dataclass(frozen=True)
class Hold:
    """Main to body, from the panel: hold one parameter at a value, or release it.

    Attributes
    ----------
    index : which parameter.
    value : its value; None gives it back to the layers below.
    """

    index: int
    value: float | None


@dataclass(frozen=True)
class Show:
    """Main to body, from the panel: show a named expression at an intensity 0..1."""

    name: str
    intensity: float


@dataclass(frozen=True)
class Neutral:
    """Main to body, from the panel: release everything and return to neutral over ``seconds``."""

    seconds: float


@dataclass(frozen=True)
class Ready:
    """The servos stand; the body waits for :class:`Begin`.

    Attributes
    ----------
    notes : what a user should know, a line each: ports that were made, servos found.
    """

    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Failed:
    """The body could not come up, or gave up; carries the error's message and hint."""

    message: str
    hint: str = ""


@dataclass(frozen=True)
class Finished:
    """The body has nothing left to play."""


@dataclass(frozen=True)
class Report:
    """What the body measured."""

    content: dict[str, object] = field(default_factory=dict)
