"""Decides whether a link accepts a line without a checksum.

A single wrong bit can turn the ``*`` before a checksum into another character, so that a line with a checksum becomes
one without, whose last number has more digits. So a link whose other end sends checksums refuses lines without one.
"""

from __future__ import annotations

from controller.base.errors import ParameterError
from controller.links.line.protocol import Code, LineError, Words

CHECKSUMS = ("optional", "latched", "required")
"""When a link requires checksums: never, after the first line with a valid one, always."""


class ChecksumRule:
    """The checksum rule of one link.

    mode : the current one of :data:`CHECKSUMS`. The other end may change it unless the stage file requires checksums.
    """

    def __init__(self, mode: str = "optional") -> None:
        self.mode = mode
        self._fixed = mode == "required"
        self._seen = False

    def check(self, words: Words) -> None:
        """Raise LineError for a line without a required checksum.

        The error has no tag, because the line and its tag may be damaged.
        """
        if words.checked:
            self._seen = True
        elif self._is_required and not (_is_change(words) and not self._fixed):
            raise LineError(Code.CHECKSUM, self._reason())

    def change(self, mode: str, *, checked: bool) -> None:
        """Set the mode on request of the other end; ``checked`` : whether its line had a checksum.

        Raises ParameterError: the stage file requires checksums.
        """
        if self._fixed and mode != self.mode:
            raise ParameterError("the stage's file requires checksums on this link", hint='checksum = "latched"')
        self.mode, self._seen = mode, checked

    @property
    def _is_required(self) -> bool:
        return self.mode == "required" or (self.mode == "latched" and self._seen)

    def _reason(self) -> str:
        if self._fixed:
            return 'the line ends without *HH, a checksum, which the stage\'s file requires (checksum = "required")'
        why = "this link requires one" if self.mode == "required" else "an earlier line had one"
        return f"the line ends without *HH, a checksum, and {why}; at a terminal send HELLO checksum=optional first"


def _is_change(words: Words) -> bool:
    """Whether a line requests another mode, which a person who cannot compute checksums must be able to do."""
    command, *rest = words.words
    return command.upper() == "HELLO" and len(rest) == 1 and rest[0].lower().startswith("checksum=")
