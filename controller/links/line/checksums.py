"""Decides whether a line without a checksum is taken on a link.

A single wrong bit can turn the ``*`` before a checksum into another character, and a line with a checksum into one
without, whose number has more digits. So a link whose other end sends checksums takes no lines without one.
"""

from __future__ import annotations

from controller.base.errors import ParameterError
from controller.links.line.protocol import Code, LineError, Words

CHECKSUMS = ("optional", "latched", "required")
"""When a link demands checksums: never, once a line had a valid one, always."""


class ChecksumRule:
    """The rule of one link, which the stage's file chooses.

    ``mode`` : one of :data:`CHECKSUMS`, what holds now; the other end may change it, but not where the stage's file
    requires checksums.
    """

    def __init__(self, mode: str = "optional") -> None:
        self.mode = mode
        self._fixed = mode == "required"
        self._seen = False

    def check(self, words: Words) -> None:
        """Raises LineError for a line without a checksum that must have one.

        The error has no tag: the line may be damaged, its tag as well, and whoever sent it sends it again.
        """
        if words.checked:
            self._seen = True
        elif self._demanded and not (_is_change(words) and not self._fixed):
            raise LineError(Code.CHECKSUM, self._reason())

    def change(self, mode: str, *, checked: bool) -> None:
        """Set the mode as the other end asks; ``checked`` : its line had a checksum.

        Raises ParameterError: the stage's file requires checksums.
        """
        if self._fixed and mode != self.mode:
            raise ParameterError("the stage's file requires checksums on this link", hint='checksum = "latched"')
        self.mode, self._seen = mode, checked

    @property
    def _demanded(self) -> bool:
        return self.mode == "required" or (self.mode == "latched" and self._seen)

    def _reason(self) -> str:
        if self._fixed:
            return 'the line ends without *HH, a checksum, which the stage\'s file requires (checksum = "required")'
        why = "this link requires one" if self.mode == "required" else "an earlier line had one"
        return f"the line ends without *HH, a checksum, and {why}; at a terminal send HELLO checksum=optional first"


def _is_change(words: Words) -> bool:
    """Whether a line asks for another mode: the way out for a person who cannot compute checksums."""
    command, *rest = words.words
    return command.upper() == "HELLO" and len(rest) == 1 and rest[0].lower().startswith("checksum=")
