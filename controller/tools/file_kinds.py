"""Finds out which kind of settings a TOML file holds, from its keys and not from its name.

A file is of the kind that shares the most keys with it, so that a file with a misspelt key is still recognised.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from controller.layers.idle.settings import IdleSettings
from controller.layers.settings import LayerTable
from controller.robot.calibration import CalibrationFile
from controller.robot.fault_script import FaultScript
from controller.robot.settings import RobotSettings
from controller.stage.persons import PersonSettings
from controller.stage.stage import StageSettings
from controller.stage.study import StudySettings
from controller.takes.retarget import RangesFile
from controller.vocabulary.controls import ControlsFile


@dataclass(frozen=True)
class FileKind:
    """A kind of file.

    name : for people. keys : top-level keys that it may have. inside : keys of its tables, for kinds whose table names
    are chosen by the user.
    """

    name: str
    keys: frozenset[str] = frozenset()
    inside: frozenset[str] = frozenset()

    def likeness(self, table: Mapping[str, Any]) -> float:
        """Return a score of how well a file fits this kind: a key that several kinds have counts a fraction."""
        own = sum(1.0 / sum(key in kind.keys for kind in KINDS) for key in self.keys & set(table))
        return own + sum(bool(self.inside & set(each)) for each in table.values() if isinstance(each, Mapping))


CALIBRATION = FileKind("calibration", frozenset(CalibrationFile.known_keys()))
ROBOT = FileKind("robot", frozenset(RobotSettings.known_keys()))
STAGE = FileKind("stage", frozenset(StageSettings.known_keys()))
PERSON = FileKind("person", frozenset(PersonSettings.known_keys()))
SCRIPT = FileKind("script", frozenset({"name", "description", "loop_s", "frames_hz", "marks", "steps"}))
FAULTS = FileKind("timeline of faults", frozenset(FaultScript.known_keys()))
LIFE = FileKind("life", frozenset(IdleSettings.known_keys()))
PARAMETERS = FileKind("parameters", frozenset({"profile", "parameters", "aliases"}))
UNITS = FileKind("action units", frozenset({"units", "emotions"}))
VISEMES = FileKind("visemes", frozenset({"visemes", "rhubarb", "phonemes", "ipa", "sapi", "letters", "through"}))
PRESETS = FileKind("presets", frozenset({"presets"}))
CONTROLS = FileKind("controls", frozenset(ControlsFile.known_keys()))
RANGES = FileKind("ranges", frozenset(RangesFile.known_keys()))
STUDY = FileKind("study", frozenset({*StudySettings.known_keys()} - {"name", "description"}))
MOODS = FileKind("moods", frozenset({"anchors"}))
LAYERS = FileKind("layers", inside=frozenset(LayerTable.known_keys()))
EXPRESSIONS = FileKind(
    "expressions",
    inside=frozenset({"kind", "source", "onset_s", "offset_s", "blink", "gaze", "mouth", "of", "weights"}),
)
KINDS = (
    STAGE, ROBOT, CALIBRATION, PERSON, SCRIPT, FAULTS, LIFE, PARAMETERS, UNITS, VISEMES, PRESETS, CONTROLS, RANGES,
    STUDY, MOODS, LAYERS, EXPRESSIONS,
)  # fmt: skip


def kind_of(table: Mapping[str, Any]) -> FileKind | None:
    """Return the kind of a file's table, or None if no kind has any of its keys."""
    likeness = {kind: kind.likeness(table) for kind in KINDS}
    if isinstance(table.get("channels"), Mapping):
        del likeness[ROBOT]  # its channels are a list
    best = max(likeness, key=lambda kind: likeness[kind])
    return best if likeness[best] > 0.0 else None
