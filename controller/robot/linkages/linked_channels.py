"""Channels that a linkage joins, such as the two servos of a differential: from parameters to their servo angles.

Parameters give the inputs of a linkage, such as roll and pitch; its geometry gives the angles of its servos.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from controller.base.parameters import Floats, Indices, Parameters
from controller.robot.formulas import Compiled, Formula, parse_formula
from controller.robot.linkages.kind import LINKAGES, Linkage, LinkageSettings
from controller.robot.terms import TermSettings


@dataclass
class LinkedChannels:
    """The channels of one linkage.

    name : of the linkage. at : (n,) indices of its channels on the bus. needs : (k,) indices of the parameters that its
    inputs follow.
    outside : whether the last inputs were unreachable. times : how often inputs became unreachable.
    """

    name: str
    at: Indices
    needs: Indices
    linkage: Linkage
    inputs: tuple[Compiled, ...]
    outside: bool = False
    times: int = field(default=0)

    @classmethod
    def of(cls, settings: LinkageSettings, names: Sequence[str], parameters: Parameters) -> LinkedChannels:
        """Create from the settings of a linkage; ``names`` are the channels of the bus.

        Raises ParameterError, ConfigError, ValueError.
        """
        made = LINKAGES.get(settings.kind).make(settings)
        inputs = tuple(_input(each, parameters) for each in settings.inputs.values())
        named = [_named(each) for each in settings.inputs.values()]
        needs = np.unique(parameters.indices(name for each in named for name in each))
        at = np.array([names.index(name) for name in settings.channels], dtype=np.intp)
        return cls(settings.name, at, needs, made, inputs)

    def __call__(self, values: Floats) -> Floats:
        """(n,) degrees of its channels before their map, for parameters (p,); all NaN where an input has no value."""
        given = values.tolist()
        inputs = np.array([each(given) for each in self.inputs])
        if not np.isfinite(inputs).all():
            return np.full(len(self.at), np.nan)
        angles, outside = self.linkage.angles(inputs)
        self.times += outside and not self.outside
        self.outside = outside
        return angles


def input_names(settings: LinkageSettings) -> list[tuple[str, str]]:
    """Yield the key in the robot file and the name of every parameter that the inputs of a linkage follow."""
    return [(f"inputs.{key}", name) for key, each in settings.inputs.items() for name in _named(each)]


def _named(given: str | dict[str, TermSettings]) -> tuple[str, ...]:
    return parse_formula(given).names if isinstance(given, str) else tuple(given)


def _input(given: str | dict[str, TermSettings], parameters: Parameters) -> Compiled:
    """Return the function that computes an input from a list of parameter values."""
    if isinstance(given, str):
        formula: Formula = parse_formula(given)
        return formula.compiled(parameters)
    terms = [(i := parameters.index(name), *term.points(parameters.low[i], parameters.high[i]), term)
             for name, term in given.items()]  # fmt: skip

    def value(values: list[float]) -> float:
        return sum(
            term.by * values[i] if term.is_weight else float(np.interp(values[i], at, gives))
            for i, at, gives, term in terms
        )

    return value
