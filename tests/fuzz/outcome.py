"""How a process that read damaged files ended, and what is wrong with that."""

from __future__ import annotations

import re
import signal
from dataclasses import dataclass

PROCESSOR_S = 2.0
MEMORY_MB = 500
MOST_TEXT = 40_000  # characters of a message: fifty faults of a file with long names
INTERNALS = re.compile(  # Python's own words, which say nothing to who wrote the file
    r"NoneType|object has no attribute|not subscriptable|unhashable|<class |out of (range|bounds) for axis|"
    r"(list|tuple) index out of range|unsupported operand|codec can't|object is not|positional argument|"
    r"constrained-|function-(before|after|wrap|plain)"
)
MESSAGE = re.compile(r"^error:", re.MULTILINE)


@dataclass(frozen=True)
class Outcome:
    """How one file was read.

    code : exit code, or minus the signal that ended the process. processor_s : processor time, also of processes
    that it started. memory_mb : how far its memory grew. output : what it printed. most_s : processor time allowed.
    """

    code: int
    processor_s: float
    memory_mb: float
    output: str
    most_s: float = PROCESSOR_S

    @property
    def fault(self) -> str:
        """What is wrong with it; empty when nothing is."""
        if self.code < 0:
            return f"ended by {signal.Signals(-self.code).name}"
        if self.code not in (0, 1):
            return f"exit code {self.code}"
        if "Traceback" in self.output:
            return "a traceback"
        if self.code == 1 and (count := len(MESSAGE.findall(self.output))) != 1:
            return f"{count} messages"
        if self.processor_s > self.most_s:
            return f"{self.processor_s:.1f} s of processor time"
        if self.memory_mb > MEMORY_MB:
            return f"{self.memory_mb:.0f} MB"
        return self._fault_of_text()

    def _fault_of_text(self) -> str:
        if len(self.output) >= MOST_TEXT:
            return f"a message of over {MOST_TEXT} characters"
        found = INTERNALS.search(self.output) if self.code else None
        return f"a message in Python's words: {found.group()}" if found else ""
