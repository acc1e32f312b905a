"""Definition of the family of boards that read lines of text, and its options."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.base.errors import DriverError
from drivers.base.options import option
from drivers.core.families import Family, PulseSettings
from drivers.text.template import TEXTS, check_texts


@dataclass(frozen=True, kw_only=True)
class TextSettings(PulseSettings):
    """Options of the driver of a text board."""

    template: str | None = option("One servo's move.")
    begin: str | None = option("Text before the moves of one line.")
    separator: str | None = option("Text between the moves.")
    end: str | None = option("Text after the moves.")
    off: str | None = option("Text that switches one servo off.")
    query: str | None = option("Request for one servo.")
    answer: str | None = option("Answer to the request; needed with query.")

    def check(self, rate_hz: float) -> None:
        """Raises ValueError where the texts are no valid templates, or contradict each other."""
        if self.template is None:
            raise ValueError(r'template is missing: how a move is written, for example "#{ch}P{us}\r"')
        try:
            check_texts(**{key: getattr(self, key) or "" for key in TEXTS})
        except DriverError as error:
            raise ValueError(f"{error} ({error.hint})") from error


FAMILY = Family(
    api=1,
    kind="text",
    title="boards that read lines of text",
    driver="drivers.text.bus:TextBus",
    settings=TextSettings,
    check_model="drivers.boards.hobby:check_hobby",
    simulator="drivers.sim.boards.textboard:SIMULATOR",
    hobby=True,
    install="pyserial",
)
