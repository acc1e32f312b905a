"""Lines for the fuzzer of the line protocol: right ones of every command, damaged ones, noise, overlong ones."""

from __future__ import annotations

import random

from controller.base.parameters import PARAMETERS
from controller.links.line.commands import COMMANDS, LISTS, READINGS
from controller.links.line.protocol import MAX_LINE, checksum
from controller.vocabulary.vocabulary import Vocabulary
from tests.fuzz.mutators import mutate

SCRIPTS = ("fuzz", "tour", "everything", "stage", "nothing", "/etc/passwd", "../fuzz", "a" * 300, ".", "fuzz.toml", "*")
NUMBERS = ("0", "1", "0.5", "-1", ".25", "1e-9", "60", "200", "0.05", "2", "-95", "1e999", "nan", "1_0", "0x1", "+.5e0")
ENDS = (b"\n", b"\n", b"\n", b"\r", b"\r\n")


class Lines:
    """Draws lines. Every line has its end; tags stay below 1,000,000, so that the tags of probes are others."""

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)
        self._expressions = Vocabulary.load(PARAMETERS).names
        self._arguments = {
            "SET": self._settings, "FRAME": lambda: [self._number() for _ in range(self._draw.choice((1, 58, 59, 59)))],
            "RELEASE": self._names, "GET": self._names, "MEASURED": self._names, "INFO": self._names,
            "EXPR": self._expression, "GAZE": self._gaze, "NEUTRAL": lambda: [self._pick("0", "0", "0.05", "1", "61")],
            "LIFE": lambda: [self._pick("0", "1", "0.5", "2"), *self._draw.choice(([], ["LISTEN"], ["auto"], ["x"]))],
            "SHOW": self._show, "READ": self._reading,
            "TO": lambda: [self._pick("maple", "ALL", "x" * 40)], "TURN": lambda: [self._pick("OFF", "maple", "@x")],
            "VISEME": lambda: self._draw.choice((["aa"], ["PP", "0.5"], ["oh", "1", "I", "0.2"], ["aa", "2"], ["x"])),
            "AUTH": lambda: self._draw.choice((["x"], ["a-token-of-some-length"], [])),
            "HELP": lambda: self._draw.choice(([], ["SET"], ["x"])),
            "LIST": lambda: [self._pick(*LISTS)], "SUB": self._stream, "PING": lambda: ["x" * self._draw.randrange(40)],
            "HELLO": lambda: self._draw.choice(([], [], ["checksum=latched"], ["checksum=required"], ["checksum=x"])),
        }  # fmt: skip

    def right(self) -> bytes:
        """A line of any command, with a tag or a checksum or neither; most of them are accepted."""
        command = self._draw.choice(COMMANDS)
        words = [command, *self._arguments.get(command, list)()]
        if self._draw.random() < 0.3:
            words.insert(0, f"#{self._draw.randrange(10**6)}")
        line = " ".join(words).encode()
        return line + b"*%02X" % checksum(line) if self._draw.random() < 0.3 else line

    def any(self) -> bytes:
        """A line of any sort, with its end."""
        kind = self._draw.random()
        if kind < 0.5:
            line = self.right()
        elif kind < 0.85:
            line = mutate(self.right(), self._draw)
        elif kind < 0.97:
            line = self._draw.randbytes(self._draw.randrange(120))
        else:
            line = self.right() + self._draw.randbytes(self._draw.choice((1, 2, 5)) * MAX_LINE)
        return line + self._draw.choice(ENDS)

    def flood(self) -> list[bytes]:
        """Many short commands that take effect at once, as a host sends that has lost its head."""
        words = ("NEUTRAL 0", "EXPR smile 1 0.05", "SHOW SEEK 0", "SHOW fuzz", "GAZE OFF", "LIFE 1", "SET jawOpen 1")
        chosen = self._draw.sample(words, self._draw.randint(1, 3))
        return [self._pick(*chosen).encode() + b"\n" for _ in range(self._draw.randint(50, 300))]

    def _pick(self, *words: str) -> str:
        return self._draw.choice(words)

    def _number(self) -> str:
        return self._pick(*NUMBERS) if self._draw.random() < 0.3 else f"{self._draw.random():.4f}"

    def _name(self) -> str:
        return self._pick(*PARAMETERS.names)

    def _names(self) -> list[str]:
        return self._draw.choice((["ALL"], [self._name()], [self._name() for _ in range(5)]))

    def _settings(self) -> list[str]:
        return [word for _ in range(self._draw.randint(1, 6)) for word in (self._name(), self._number())]

    def _expression(self) -> list[str]:
        name = self._pick(*self._expressions, "smile", "AU1+2+5B", "AUR12C+R14D", "AU99", "VA:0.6,-0.2", "VAD:0,0,1")
        return [name, *[self._number() for _ in range(self._draw.randrange(3))]]

    def _gaze(self) -> list[str]:
        there = ["AT", *[f"{self._draw.uniform(-900, 900):.1f}" for _ in range(3)]]
        return self._draw.choice((["OFF"], there, [f"{self._draw.uniform(-99, 99):.1f}", self._number()]))

    def _show(self) -> list[str]:
        seek = ["SEEK", self._pick("0", "1", "1_0", "middle", "1e9", "-1", "nan")]
        return self._draw.choice(([self._pick(*SCRIPTS)], ["PLAY"], ["PAUSE"], ["STOP"], seek, seek))

    def _reading(self) -> list[str]:
        return [self._pick(*READINGS), *self._draw.choice(([], ["MEASURED"]))]

    def _stream(self) -> list[str]:
        what = self._draw.choice((["ALL"], [self._name()], ["MEASURED"], ["READ", *self._reading()]))
        return [self._pick("0.1", "10", "200", "0"), *what]
