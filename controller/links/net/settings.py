"""Defines the options of a link that uses a message format."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import ClassVar

from controller.formats.format import Format
from controller.links.access import check_word
from controller.links.net.address import Address, has_token, is_called, parse_address
from drivers.base.options import Option, option

LOST = ("fade", "hold", "neutral", "stop")
"""What a link does when its source is lost: fade out its layer, hold the last face, show neutral, or stop servos."""
EYES = ("auto", "looks", "angles", "both")
"""Which values set the gaze: those that move (``auto``), the eyeLook shapes, the eye angles, or the sum of both."""
SENDS = ("face", "servos", "both")
"""What a link sends: the commanded face, the face that the servos show, or both."""
CALIBRATE = ("off", "keep", "again")
"""Whether a neutral face is learned: never, once and then kept in a file, or at each start."""


@dataclass(frozen=True, kw_only=True)
class NetSettings:
    """Options of the link in a stage file."""

    form: ClassVar[Format]
    """The format; each has its own subclass."""

    listen: str | None = option("HOST:PORT at which faces are received; - for standard input.")
    connect: str | None = option("HOST:PORT of a program to connect to for faces.")
    port: str | None = option("Serial port at which faces are received.")
    baud: int = option("Rate of a serial port.", 115_200, at_least=300, at_most=12_000_000)
    send: str | None = option("HOST:PORT, or serial port, to which the current face is sent.")
    rate_hz: float = option("How often the current face is sent.", 60.0, at_least=0.1, at_most=500.0)
    sends: str = option("What is sent: the face, the face that the servos show, or both.", "face", choices=SENDS)
    layer: str = option("The layer that received values are written to.", "capture")
    source: str | None = option("Accept only frames from this host or of this subject.")
    timeout_s: float | None = option("A source that is silent for this long is lost.", above=0.0, at_most=3600.0)
    lost: str = option("What happens when the source is lost.", "fade", choices=LOST)
    mirror: bool = option("Whether to swap left and right, as in a mirror.", False)
    eyes: str = option("Whether eyeLook shapes or eye angles set the gaze.", "auto", choices=EYES)
    gains: dict[str, float] = field(
        default_factory=dict, metadata={"option": Option(help="Factors on the values by region.")}
    )
    smoothing: bool = option("Whether values are smoothed (One Euro filter).", False)
    min_cutoff_hz: float = option("Cut-off of the smoothing at rest.", 2.0, above=0.0, at_most=100.0)
    beta: float = option("How much the cut-off rises with speed.", 1.0, at_least=0.0, at_most=100.0)
    calibrate: str = option("Whether a neutral face is learned.", "off", choices=CALIBRATE)
    ranges: bool = option("Whether the range of each parameter is learned.", False)
    open_to_network: bool = option("Allow others than programs on this machine to send faces.", False)
    token: str | None = option("Token with which streams and datagrams begin, in and out.", longest=128)

    def check(self) -> None:
        """Raises ValueError: no address, an invalid one, or one that other machines reach without permission."""
        if not any((self.listen, self.connect, self.port, self.send)):
            raise ValueError(f'give listen, connect, port or send, as listen = "127.0.0.1:{self.form.port or 9400}"')
        if sum(each is not None for each in (self.listen, self.connect, self.port)) > 1:
            raise ValueError("give only one of listen, connect and port")
        if self.connect is not None and not is_called(self.form, parse_address(self.connect, self.form)):
            raise ValueError("connect: only TCP can be connected to; write it as tcp:HOST:PORT")
        if self.send is not None:
            parse_address(self.send, self.form)
        if self.sends == "both" and not self.form.measured:
            raise ValueError(f'sends: {self.form.kind} has no room for both; "servos" sends what the servos show')
        self._check_reach()
        if any(not 0.0 <= gain <= 4.0 for gain in self.gains.values()):
            raise ValueError("gains: must be 0 to 4")

    def _check_reach(self) -> None:
        incoming = self.incoming
        if self.token is not None:
            if not any(end is not None and has_token(self.form, end) for end in (incoming, self.outgoing)):
                kinds = "TCP and UDP have one" if self.form.takes_token else f"TCP has one for {self.form.kind}"
                raise ValueError(f"token: only {kinds}; this link has no place for it")
            check_word(self.token)
        if incoming is not None and self.connect is None and not incoming.is_local and not self.open_to_network:
            raise ValueError(
                f"listen: at {incoming.host} every machine that reaches this one could move the face; "
                "open_to_network = true allows it"
            )

    @property
    def needs_token(self) -> bool:
        """Whether incoming streams or datagrams must begin with a token."""
        incoming = self.incoming
        if incoming is None or not has_token(self.form, incoming) or self.connect is not None:
            return False
        return self.token is not None or (self.form.takes_token and not incoming.is_local)

    @property
    def silence_s(self) -> float:
        """How long a source may be silent before it counts as lost."""
        return self.form.timeout_s if self.timeout_s is None else self.timeout_s

    @property
    def incoming(self) -> Address | None:
        """Where faces come from; None for a link that only sends."""
        if self.port is not None:
            return parse_address(f"serial:{self.port}", self.form)
        text = self.listen if self.listen is not None else self.connect
        return None if text is None else parse_address(text, self.form)

    @property
    def takes_input(self) -> bool:
        """Whether faces come from standard input."""
        return self.incoming is not None and self.incoming.transport == "lines"

    @property
    def outgoing(self) -> Address | None:
        """Where the current face is sent; None for a link that only receives."""
        return None if self.send is None else parse_address(self.send, self.form)

    @property
    def is_one_port(self) -> bool:
        """Whether faces are received from the same serial port to which the current face is sent."""
        ends = [end.device for end in (self.incoming, self.outgoing) if end is not None and end.transport == "serial"]
        return len(ends) == 2 and os.path.realpath(ends[0]) == os.path.realpath(ends[1])

    @property
    def address(self) -> str:
        """Both ends of the link, for people."""
        ends = [str(self.incoming)] if self.incoming is not None else []
        return " and ".join([*ends, *([f"{self.outgoing} (out)"] if self.outgoing is not None else [])])
