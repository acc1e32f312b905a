"""Studies: arranges conditions in a seeded order as one script, with a mark where each trial begins and ends."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tomli_w
from pydantic import Field

from controller.base.config import Settings, load
from controller.base.errors import ConfigError
from controller.base.files import replacing
from controller.base.parameters import Parameters
from controller.base.paths import find_config
from controller.links.line.commands import Grammar
from controller.links.line.protocol import LineError
from controller.links.line.script import MAX_STEPS, load_script, read_step
from controller.stage.stage import load_stage
from controller.vocabulary.vocabulary import Vocabulary

_Seconds = Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)]
_Name = Annotated[str, Field(pattern=r"^[!-)+-~]{1,64}$")]
_RETURN_S = 0.4  # time of the return to the neutral face, at most the pause between trials
MAX_TRIALS = 2000


class Condition(Settings):
    """One condition: timed lines of the line protocol, as in a script, or the name of a script; and its length.

    Steps of a script after ``length_s``, and its marks, are omitted.
    """

    steps: Annotated[list[str], Field(max_length=1000)] = []
    script: str | None = None
    length_s: Annotated[_Seconds, Field(gt=0)]


class StudySettings(Settings):
    """The contents of a study's file.

    order : ``shuffled`` shuffles all trials together; ``blocks`` shows every condition once, in random order, before
    any is repeated; ``given`` keeps the order of the file.
    """

    name: str
    description: str = ""
    stage: str
    seed: Annotated[int, Field(ge=0)] = 0
    repeats: Annotated[int, Field(ge=1, le=1000)] = 1
    order: Literal["shuffled", "blocks", "given"] = "blocks"
    before_s: _Seconds = 1.0
    pause_s: _Seconds = 1.0
    conditions: Annotated[dict[_Name, Condition], Field(min_length=1, max_length=200)]


@dataclass(frozen=True)
class Trial:
    """One presentation of a condition: its number from 1, and its begin and end (s) after the start of the study."""

    number: int
    condition: str
    begin_s: float
    end_s: float


@dataclass(frozen=True)
class Study:
    """A study with its trials in order.

    length_s : duration. steps : (time s, line), ascending in time. marks : times (s) by name.
    """

    settings: StudySettings
    trials: tuple[Trial, ...]
    steps: tuple[tuple[float, str], ...]
    marks: dict[str, float]
    length_s: float


def load_study(path: Path, parameters: Parameters, seed: int | None = None) -> Study:
    """Read a study. ``seed`` : overrides the file's, for example by the number of a participant.

    Raises ConfigError: the file, its stage or one of its scripts cannot be read or is wrong; lists every fault.
    """
    settings = load(path, StudySettings, _faults)
    vocabulary = load_stage(str(find_config("stages", settings.stage, beside=path)), parameters).vocabulary
    grammar = Grammar(parameters, lambda name: vocabulary[name].name, scripted=True)
    load(path, StudySettings, lambda settings: _line_faults(settings, grammar))
    lines = {name: _lines(path, each, parameters, vocabulary, grammar) for name, each in settings.conditions.items()}
    order = _order_trials(settings, settings.seed if seed is None else seed)
    trials, at_s = [], settings.before_s
    for number, name in enumerate(order, 1):
        end_s = at_s + settings.conditions[name].length_s
        trials.append(Trial(number, name, at_s, end_s))
        at_s = end_s + settings.pause_s
    return_s = min(_RETURN_S, settings.pause_s)
    steps = [step for trial in trials for step in _steps(trial, lines[trial.condition], return_s)]
    marks = {f"{trial.number}:{trial.condition}:{event}": time_s for trial in trials
             for event, time_s in (("begin", trial.begin_s), ("end", trial.end_s))}  # fmt: skip
    if len(steps) > MAX_STEPS:
        fault = f"{path}: repeats: {len(steps)} lines in all are more than {MAX_STEPS}"
        raise ConfigError(fault, hint="repeat the conditions less often")
    return Study(settings, tuple(trials), tuple(steps), marks, at_s)


def write_script(study: Study, path: Path) -> None:
    """Write a study as a script that a stage plays as a show. Raises ControllerError: it cannot be written."""
    table = {
        "name": study.settings.name,
        "marks": study.marks,
        "steps": [f"{at_s:.3f} {line}" for at_s, line in study.steps],
    }
    with replacing(path) as temporary:
        temporary.write_text(tomli_w.dumps(table), encoding="utf-8")


def _steps(trial: Trial, lines: list[tuple[float, str]], return_s: float) -> list[tuple[float, str]]:
    """Return the lines of a trial at their times, and at its end the return to the neutral face in ``return_s``."""
    steps = [(trial.begin_s + at_s, line) for at_s, line in lines if trial.begin_s + at_s <= trial.end_s]
    return [*steps, (trial.end_s, f"NEUTRAL {return_s:g}")]


def _order_trials(settings: StudySettings, seed: int) -> list[str]:
    """Return the name of the condition of each trial; the same seed gives the same order."""
    draw, names = random.Random(seed), list(settings.conditions)
    if settings.order == "given":
        return names * settings.repeats
    if settings.order == "shuffled":
        every = names * settings.repeats
        draw.shuffle(every)
        return every
    return [name for _ in range(settings.repeats) for name in draw.sample(names, len(names))]


def _lines(
    path: Path, condition: Condition, parameters: Parameters, vocabulary: Vocabulary, grammar: Grammar
) -> list[tuple[float, str]]:
    """Return the timed lines of a condition, ascending in time."""
    if condition.script is not None:
        return list(load_script(condition.script, parameters, vocabulary, beside=path).steps)
    return sorted((read_step(text, grammar) for text in condition.steps), key=lambda step: step[0])


def _line_faults(settings: StudySettings, grammar: Grammar) -> list[str]:
    """Return the faults of the steps of conditions, each with its key."""
    faults = []
    for name, condition in settings.conditions.items():
        for i, text in enumerate(condition.steps):
            try:
                at_s, _ = read_step(text, grammar)
                if at_s > condition.length_s:
                    raise ValueError(f"comes after the condition's length_s = {condition.length_s:g}")
            except (LineError, ValueError) as error:
                faults.append(f"conditions.{name}.steps[{i}]: {error} (is {text!r})")
    return faults


def _faults(settings: StudySettings) -> list[str]:
    faults = [
        f"conditions.{name}: give one of steps and script"
        for name, each in settings.conditions.items()
        if (each.script is None) == (not each.steps)
    ]
    trials = settings.repeats * len(settings.conditions)
    if trials > MAX_TRIALS:
        faults.append(f"repeats: {trials} trials are more than {MAX_TRIALS}")
    return faults
