"""Options of a link in one of the formats."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import ClassVar

from controller.formats.format import Format
from controller.links.access import check_word
from controller.links.net.address import Address, has_token, is_called, parse_address
from drivers.base.options import Option, option

LOST = ("fade", "hold", "neutral", "stop")
"""What a link does when its source falls silent: give its layer back, keep the last face, show neutral, stop servos."""
EYES = ("auto", "looks", "angles", "both")
"""Which of two ways to say where the eyes look counts: the eyeLook names, the eye angles, what moves, or both added."""
SENDS = ("face", "servos", "both")
"""What a link sends: the face that is shown, what the measured servos show of it, or the face with that beside it."""
CALIBRATE = ("off", "keep", "again")
"""Whether a neutral face is learned: never, once and kept in a file, or at each start."""


@dataclass(frozen=True, kw_only=True)
class NetSettings:
    """Keys of such a link in a stage."""

    form: ClassVar[Format]
    """The format; a subclass for each."""

    listen: str | None = option("HOST:PORT at which faces are taken; - for standard input.")
    connect: str | None = option("HOST:PORT of a program that is called for faces.")
    port: str | None = option("Serial port at which faces are taken.")
    baud: int = option("Rate of a serial port.", 115_200, at_least=300, at_most=12_000_000)
    send: str | None = option("HOST:PORT, or serial port, to which the present face is sent.")
    rate_hz: float = option("How often the present face is sent.", 60.0, at_least=0.1, at_most=500.0)
    sends: str = option("What is sent: the face, what the servos show, or both.", "face", choices=SENDS)
    layer: str = option("The layer that shows what is taken.", "capture")
    source: str | None = option("Take only what comes from this host, or shows this subject.")
    timeout_s: float | None = option("A source that is silent for so long is lost.", above=0.0, at_most=3600.0)
    lost: str = option("What happens when the source is lost.", "fade", choices=LOST)
    mirror: bool = option("Whether left and right change places, as in a mirror.", False)
    eyes: str = option("Which of eyeLook names and eye angles counts.", "auto", choices=EYES)
    gains: dict[str, float] = field(
        default_factory=dict, metadata={"option": Option(help="Factors on the values by region.")}
    )
    smoothing: bool = option("Whether values are smoothed (One Euro filter).", False)
    min_cutoff_hz: float = option("Cut-off of the smoothing at rest.", 2.0, above=0.0, at_most=100.0)
    beta: float = option("How much the cut-off rises with speed.", 1.0, at_least=0.0, at_most=100.0)
    calibrate: str = option("Whether a neutral face is learned.", "off", choices=CALIBRATE)
    ranges: bool = option("Whether the range of each parameter is learned.", False)
    open_to_network: bool = option("Allow others than programs on this machine to send faces.", False)
    token: str | None = option("What streams and datagrams begin with, in and out.", longest=128)

    def check(self) -> None:
        """Raises ValueError: no address, one that is wrong, or one that others reach without leave."""
        if not any((self.listen, self.connect, self.port, self.send)):
            raise ValueError(f'give listen, connect, port or send, as listen = "127.0.0.1:{self.form.port or 9400}"')
        if sum(each is not None for each in (self.listen, self.connect, self.port)) > 1:
            raise ValueError("give only one of listen, connect and port")
        if self.connect is not None and not is_called(self.form, parse_address(self.connect, self.form)):
            raise ValueError("connect: only TCP is called; write it as tcp:HOST:PORT")
        if self.send is not None:
            parse_address(self.send, self.form)
        if self.sends == "both" and not self.form.measured:
            raise ValueError(f'sends: {self.form.kind} has no room for both; "servos" sends what the servos show')
        self._check_reach()
        if any(not 0.0 <= gain <= 4.0 for gain in self.gains.values()):
            raise ValueError("gains: must be 0 to 4")

    def _check_reach(self) -> None:
        here = self.incoming
        if self.token is not None:
            if not any(end is not None and has_token(self.form, end) for end in (here, self.outgoing)):
                kinds = "TCP and UDP have one" if self.form.takes_token else f"TCP has one for {self.form.kind}"
                raise ValueError(f"token: only {kinds}; this link has no place for it")
            check_word(self.token)
        if here is not None and self.connect is None and not here.is_local and not self.open_to_network:
            raise ValueError(
                f"listen: at {here.host} every machine that reaches this one could move the face; "
                "open_to_network = true allows it"
            )

    @property
    def needs_token(self) -> bool:
        """Whether the streams or datagrams that come must begin with a token."""
        here = self.incoming
        if here is None or not has_token(self.form, here) or self.connect is not None:
            return False
        return self.token is not None or (self.form.takes_token and not here.is_local)

    @property
    def silence_s(self) -> float:
        """How long a source may be silent."""
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
        """Where the present face goes; None for a link that only takes."""
        return None if self.send is None else parse_address(self.send, self.form)

    @property
    def is_one_port(self) -> bool:
        """Whether faces come from the serial port to which the present face is sent."""
        ends = [end.device for end in (self.incoming, self.outgoing) if end is not None and end.transport == "serial"]
        return len(ends) == 2 and os.path.realpath(ends[0]) == os.path.realpath(ends[1])

    @property
    def address(self) -> str:
        """Its ends, for people."""
        ends = [str(self.incoming)] if self.incoming is not None else []
        return " and ".join([*ends, *([f"{self.outgoing} (out)"] if self.outgoing is not None else [])])
