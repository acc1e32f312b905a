"""One head of a stage with several, as a window reads it."""

from __future__ import annotations

from dataclasses import dataclass

from controller.base.mailboxes import Mailbox
from controller.body.panel_state import PanelState
from controller.stage.stage import Stage


@dataclass(frozen=True)
class HeadSource:
    """One head of a stage. stage : the stage reduced to this head. mailbox : its parameters. state : its state."""

    name: str
    stage: Stage
    mailbox: Mailbox
    state: PanelState
