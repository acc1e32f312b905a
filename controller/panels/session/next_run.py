"""What to open after the window has closed: another stage (configuration file), or the same with more vocabularies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from controller.base.parameters import Parameters
from controller.panels.session.commands import History, Settings
from controller.takes.livelink import Take


@dataclass(frozen=True)
class NextRun:
    """A stage to open.

    vocabularies : files that it has behind its own ones.
    carried : what was set in the window, with its undo history; None: nothing was. names : its parameters.
    held : new parameters that are held besides.
    """

    stage: Path
    vocabularies: tuple[Path, ...] = ()
    carried: History | None = None
    names: tuple[str, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)


def carried_to(run: NextRun, parameters: Parameters) -> History | None:
    """Return the settings with their undo history for ``parameters``; parameters that are missing there are left
    out.
    """
    history, at = run.carried, [parameters.find(name) for name in run.names]
    if history is None:
        return None
    now, past, future = (
        tuple(_fit_settings(each, at, parameters) for each in settings)
        for settings in ((history.now,), history.past, history.future)
    )
    more = {parameters.index(name): value for name, value in run.held.items()}
    return History(replace(now[0], held={**now[0].held, **more}), past, future)


def _fit_settings(settings: Settings, at: Sequence[int | None], parameters: Parameters) -> Settings:
    held = {new: value for i, value in settings.held.items() if (new := at[i]) is not None}
    return replace(settings, held=held, take=_fit_take(settings.take, at, parameters))


def _fit_take(take: Take | None, at: Sequence[int | None], parameters: Parameters) -> Take | None:
    if take is None:
        return None
    values, mask = np.tile(parameters.neutral(), (len(take.values), 1)), np.zeros(len(parameters), bool)
    for old, new in enumerate(at):
        if new is not None:
            values[:, new], mask[new] = take.values[:, old], take.mask[old]
    values.flags.writeable = mask.flags.writeable = False
    return replace(take, values=values, mask=mask, low=parameters.low, high=parameters.high, through=None)
