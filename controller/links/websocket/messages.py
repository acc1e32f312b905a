"""Defines the messages of the WebSocket API as pydantic models, from which its JSON schema is generated.

A message is a JSON object whose ``type`` says what it is. Angles are in degrees and lengths in millimetres; the axes
are those of the line protocol (yaw positive to the face's own left, pitch positive up). A message with an ``id`` is
always answered, one without only if it is a query or is refused.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

VERSION = 1
"""Version of the messages, which increases when one changes its meaning or is removed, not when one is added."""
MAX_RATE_HZ, MIN_RATE_HZ, MAX_WATCH_HZ = 200.0, 0.1, 10.0
MAX_MESSAGE_BYTES = 65_536

Name = Annotated[str, Field(min_length=1, max_length=128)]
Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
Signed = Annotated[float, Field(ge=-1.0, le=1.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Id = Annotated[int, Field(ge=-(2**53), le=2**53)] | Annotated[str, Field(max_length=64)]


class Message(BaseModel):
    """The fields that every request may have. ``id`` : returned with the answer."""

    model_config = ConfigDict(extra="forbid", strict=False, frozen=True)
    id: Id | None = None


class Request(Message):
    """A request for the first head, or for those that ``to`` names: a head, a group of heads, or ``all``."""

    to: Annotated[str, Field(max_length=64)] | None = None

    @property
    def address(self) -> str | None:
        """The head or group that it is for; None for the first head."""
        return self.to


class Hello(Request):
    """Ask for the server's version and names. ``version`` : refused if not the server's. ``name`` : of the client."""

    type: Literal["hello"]
    version: int = VERSION
    name: Annotated[str, Field(max_length=64)] = ""


class Set(Request):
    """Hold parameters at values, until they are released."""

    type: Literal["set"]
    parameters: Annotated[dict[Name, Finite], Field(min_length=1, max_length=1000)]


class Release(Request):
    """Release held parameters; if ``parameters`` is omitted, all of them."""

    type: Literal["release"]
    parameters: Annotated[list[Name], Field(max_length=1000)] | None = None


class Expression(Request):
    """Show a named expression, or a formula such as ``AU1+2+5B``. ``duration_s`` omitted: until the next one."""

    type: Literal["expression"]
    name: Name
    intensity: Share = 1.0
    duration_s: Annotated[float, Field(ge=0.05, le=3600.0)] | None = None


class Emotion(Request):
    """Show an emotion as a point of valence, arousal and optionally dominance."""

    type: Literal["emotion"]
    valence: Signed
    arousal: Signed
    dominance: Signed | None = None
    intensity: Share = 1.0


class Gaze(Request):
    """Look in a direction."""

    type: Literal["gaze"]
    yaw_deg: Annotated[float, Field(ge=-95.0, le=95.0)]
    pitch_deg: Annotated[float, Field(ge=-70.0, le=70.0)]


class GazeAt(Request):
    """Look at a point (x, y, z), in mm from the midpoint between the eyes."""

    type: Literal["gaze_at"]
    point_mm: tuple[Finite, Finite, Finite]


class GazeRoom(Request):
    """Look at a point (x, y, z), in mm, in the coordinates of the room that several heads share."""

    type: Literal["gaze_room"]
    point_mm: tuple[Finite, Finite, Finite]


class GazeHead(Request):
    """Look at another head of the stage."""

    type: Literal["gaze_head"]
    head: Name


class Turn(Request):
    """Give a head the turn: it speaks, and the others listen and look at it. Null: nobody has the turn."""

    type: Literal["turn"]
    head: Name | None


class GazeOff(Request):
    """Stop looking at anything."""

    type: Literal["gaze_off"]


class Neutral(Request):
    """Release everything that was commanded and return to neutral."""

    type: Literal["neutral"]
    seconds: Annotated[float, Field(ge=0.0, le=60.0)] = 0.5


class Life(Request):
    """Set the amount of idle motion and the manner."""

    type: Literal["life"]
    amount: Share
    manner: Literal["auto", "alone", "listen", "speak"] | None = None


class Show(Message):
    """Play a script by name; or pause, stop or continue the one that was started, or seek a mark or a time (s).

    Because ``to`` is the place to seek, ``head`` names the head or group that the request is for.
    """

    type: Literal["show"]
    name: Name | None = None
    action: Literal["play", "pause", "stop", "seek"] | None = None
    to: Annotated[float, Field(ge=0.0, le=86_400.0)] | Name | None = None
    head: Annotated[str, Field(max_length=64)] | None = None

    @property
    def address(self) -> str | None:
        """The head or group that it is for; None for the first head."""
        return self.head


class Stop(Request):
    """Switch the servos of all robots off, until ``start``."""

    type: Literal["stop"]


class Start(Request):
    """Let the servos move again."""

    type: Literal["start"]


class Get(Request):
    """Query the state once."""

    type: Literal["get"]
    parameters: Annotated[list[Name], Field(max_length=1000)] | None = None


class List(Request):
    """Query names."""

    type: Literal["list"]
    what: Literal["parameters", "expressions", "layers", "shows", "heads", "groups"]


class Subscribe(Request):
    """Get the state at a rate; a client that reads too slowly gets fewer states, never old ones.

    ``form`` : ``names`` for messages ``state``, ``numbers`` for the shorter ``frame``.
    """

    type: Literal["subscribe"]
    rate_hz: Annotated[float, Field(ge=MIN_RATE_HZ, le=MAX_RATE_HZ)] = 30.0
    parameters: Annotated[list[Name], Field(max_length=1000)] | None = None
    form: Literal["names", "numbers"] = "names"


class Watch(Request):
    """Get an overview of servos, links and layers at a rate; the rate 0 ends it."""

    type: Literal["watch"]
    rate_hz: Annotated[float, Field(ge=0.0, le=MAX_WATCH_HZ)] = 4.0


class Unsubscribe(Request):
    """End the subscription."""

    type: Literal["unsubscribe"]


class Ping(Request):
    """Ask whether the server is there."""

    type: Literal["ping"]


AnyRequest = Annotated[
    Hello | Set | Release | Expression | Emotion | Gaze | GazeAt | GazeRoom | GazeHead | Turn | GazeOff | Neutral
    | Life | Show | Stop | Start
    | Get | List | Subscribe | Watch | Unsubscribe | Ping,
    Field(discriminator="type"),
]  # fmt: skip
REQUESTS: TypeAdapter[AnyRequest] = TypeAdapter(AnyRequest)


class Reply(BaseModel):
    """The fields that every answer may have. ``id`` : that of the request, if it had one."""

    model_config = ConfigDict(frozen=True)
    id: Id | None = None


class Welcome(Reply):
    """The answer to ``hello``. ``heads`` : names of the heads; empty if there is one head without a name."""

    type: Literal["hello"] = "hello"
    version: int = VERSION
    omote: str
    parameters: dict[str, Parameter]
    expressions: list[str]
    layers: list[str]
    heads: list[str] = []
    max_rate_hz: float = MAX_RATE_HZ
    max_bytes: int = MAX_MESSAGE_BYTES


class Parameter(BaseModel):
    """One parameter: its range, its value at rest and its region of the face. ``full_scale_deg`` : the angle of the
    value 1, for angles. ``description`` : from its vocabulary."""

    low: float
    high: float
    region: str
    full_scale_deg: float | None = None
    rest: float = 0.0
    description: str = ""


class State(Reply):
    """The face. ``time_s`` : since the server started. ``measured`` : the face that the servos show; null if no servo
    reports its position. ``status`` : short words and numbers, as ``STATUS`` of the line protocol returns them.
    """

    type: Literal["state"] = "state"
    time_s: float
    parameters: dict[str, float]
    measured: dict[str, float] | None = None
    stopped_by: str | None = None
    status: dict[str, str | int | float] = {}


class Frame(Reply):
    """The face as numbers, in the order of the subscription's ``parameters``, or else of those in ``hello``. ``life`` :
    what pictures show beside them: mm by which a breath lifts the chest, and the share by which pupils are wider than
    the light makes them.
    """

    type: Literal["frame"] = "frame"
    time_s: float
    values: list[float]
    measured: list[float] | None = None
    stopped_by: str | None = None
    life: tuple[float, float] = (0.0, 0.0)


class Overview(Reply):
    """Servos, links and layers. ``held`` : parameters that were set and not released. ``holders`` : by parameter, the
    layer that holds it. ``show`` : the current show and its position. ``servos``, ``links`` : a record for each; an
    unknown value is null or missing.
    """

    type: Literal["overview"] = "overview"
    time_s: float
    stopped_by: str | None = None
    status: dict[str, str | int | float]
    held: dict[str, float]
    holders: dict[str, str]
    show: str
    servos: list[Servo]
    links: list[dict[str, Any]]


class Servo(BaseModel):
    """One servo. Angles are in degrees. ``error`` : what is wrong, in words; empty if nothing is."""

    bus: str
    id: int
    name: str
    model: str
    low_deg: float
    high_deg: float
    wanted_deg: float
    measured_deg: float | None = None
    age_s: float | None = None
    temperature_c: float | None = None
    voltage_v: float | None = None
    current_a: float | None = None
    torque: bool | None = None
    error: str = ""


class Names(Reply):
    """The answer to ``list``."""

    type: Literal["names"] = "names"
    what: str
    names: list[str]


class Done(Reply):
    """A request with an ``id`` was carried out."""

    type: Literal["ok"] = "ok"


class Refused(Reply):
    """A request was not carried out. ``message`` : why. ``hint`` : what to do next."""

    type: Literal["error"] = "error"
    code: Literal["message", "value", "name", "busy", "rate", "fault"]
    message: str
    hint: str = ""


AnyReply = Annotated[Welcome | State | Frame | Overview | Names | Done | Refused, Field(discriminator="type")]
REPLIES: TypeAdapter[AnyReply] = TypeAdapter(AnyReply)


def schema() -> dict[str, Any]:
    """Return the JSON schema of all requests and replies, with the version of the messages."""
    requests = REQUESTS.json_schema(ref_template="#/$defs/{model}")
    replies = REPLIES.json_schema(ref_template="#/$defs/{model}", mode="serialization")
    defs = requests.pop("$defs") | replies.pop("$defs")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "omote WebSocket API",
        "version": VERSION,
        "properties": {"request": requests, "reply": replies},
        "$defs": defs,
    }
