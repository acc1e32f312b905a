"""What a check finds."""

from __future__ import annotations

from dataclasses import dataclass

AGAIN = "omote fit MESH -o {folder}"


@dataclass(frozen=True)
class Finding:
    """One defect.

    kind : a word for it. text : what is wrong and where, with figures. hint : what to type or do next.
    warning : is it something that the head lacks, and not something that is broken?
    """

    kind: str
    text: str
    hint: str
    warning: bool = False

    def line(self, folder: str) -> str:
        """Return all of it in one line, for a head in a folder."""
        return f"{self.kind}: {self.text}; next: {self.hint.replace('{folder}', folder)}"
