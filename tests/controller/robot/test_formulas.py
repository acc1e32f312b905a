"""Formulas: they are worth what Python's own arithmetic says, and nothing else than arithmetic can be written."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.robot.channels import build_table
from controller.robot.following import Mirror
from controller.robot.formulas import FUNCTIONS, clamp, formula_faults, lerp, parse_formula, smoothstep
from controller.robot.settings import Calibration, ChannelSettings

NAMES = ("jawOpen", "mouthClose", "mouthSmileLeft")
IMPLIED = "jawOpen * (1 - mouthClose) if mouthSmileLeft > 0.2 else 0.5 * jawOpen"


def face(**values: float) -> np.ndarray:
    vector = P.neutral()
    for name, value in values.items():
        vector[P.index(name)] = value
    return vector


def channel(formula: str, **changes: Any) -> ChannelSettings:
    keys: dict[str, Any] = {
        "name": "jaw", "bus": "b", "id": 1, "model": "xl330-m288", "formula": formula,
        "map": Calibration(at=[-1, 1], deg=[-40, 40]), "limit_deg": (-45, 45), "max_speed_deg_s": 300,
        "max_accel_deg_s2": 3000,
    }  # fmt: skip
    return ChannelSettings.model_validate(keys | changes)


def formulas() -> st.SearchStrategy[str]:
    leaves = st.sampled_from([*NAMES, "0.25", "2", "1.5e-1"])

    def more(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        pair = st.tuples(inner, inner)
        return (
            st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda x: f"({x[0]} {x[1]} {x[2]})")
            | st.tuples(inner, inner, inner).map(lambda x: f"({x[0]} if {x[1]} > {x[2]} else {x[2]})")
            | pair.map(lambda x: f"max({x[0]}, min({x[1]}, 1), -1)")
            | inner.map(lambda x: f"clamp(smoothstep({x}), 0.1, abs({x}) ** 2)")
        )

    return st.recursive(leaves, more, max_leaves=4)


@settings(deadline=None)
@given(formulas(), st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_it_is_worth_what_python_says(text: str, values: list[float]) -> None:
    assume(len(text) < 300)
    given_ = dict(zip(NAMES, values, strict=True))
    known = {name: function for name, (function, _, _) in FUNCTIONS.items()}
    assert parse_formula(text).compiled(P)(face(**given_).tolist()) == pytest.approx(eval(text, known, given_))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("__import__('os')", "only the functions"),
        ("jawOpen.real", "'jawOpen.real' is not allowed"),
        ("(1).__class__", "is not allowed"),
        ("jawOpen[0]", "is not allowed"),
        ("[x for x in jawOpen]", "is not allowed"),
        ("lambda: 1", "is not allowed"),
        ("(x := 1)", "is not allowed"),
        ("'a' * 9", "'a' is no number"),
        ("True", "True is no number"),
        ("1e400", "1e400 is no number below 1e9"),
        ("2j", "is no number"),
        ("9 ** 9 ** 9", "a power must be a whole number from 1 to 8"),
        ("jawOpen ** mouthClose", "a power must be a whole number"),
        ("jawOpen // 2", "FloorDiv is not allowed"),
        ("jawOpen == 2", "Eq is not allowed"),
        ("1 << 9", "LShift is not allowed"),
        ("max(jawOpen)", "max takes 2 to 16 values"),
        ("max(*jawOpen)", "max takes 2 to 16"),
        ("clamp(jawOpen, low=0, high=1)", "only the functions"),
        ("open('x')", "only the functions"),
        ("jawOpen +", "cannot be read at character"),
        ("", "cannot be read"),
        ("+".join(["jawOpen"] * 200), "is too long"),
        ("-" * 100 + "1", "nested too deeply"),
        ("(" * 300 + "1" + ")" * 300, "too long|nested too deeply|too many"),
        ("jawOpen\x00", "cannot be read"),
    ],
)
def test_nothing_else_can_be_written(text: str, fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        parse_formula(text)


def test_names_are_parameters() -> None:
    assert sorted(parse_formula(IMPLIED).names) == ["jawOpen", "mouthClose", "mouthSmileLeft"]
    with pytest.raises(ParameterError, match="did you mean 'jawOpen'"):
        parse_formula("jawOpn").compiled(P)
    assert formula_faults("1 / jawOpen", P) == [
        "has no value for the neutral face: it divides by zero there, or takes a root of less than zero"
    ]


def test_functions() -> None:
    assert (clamp(2.0, 0.0, 1.0), smoothstep(0.25), lerp(2.0, 4.0, 0.25)) == (1.0, 0.15625, 2.5)


def test_a_division_by_zero_leaves_the_servo_where_it_is() -> None:
    assert math.isnan(parse_formula("1 / jawOpen").compiled(P)(P.neutral().tolist()))
    table = build_table([channel("1 / (1 - jawOpen) - 1")], P)
    assert table.neutral_rad == pytest.approx([0.0])
    assert np.isnan(table.angles(face(jawOpen=1.0))[0]).all()


def test_a_channel_follows_its_formula() -> None:
    table = build_table([channel(IMPLIED)], P)
    assert np.degrees(table.angles(face(jawOpen=1.0))[0]) == pytest.approx([20.0])
    assert np.degrees(table.angles(face(jawOpen=1.0, mouthSmileLeft=0.3, mouthClose=0.25))[0]) == pytest.approx([30.0])
    assert table.reached[P.indices(NAMES)].all()


@pytest.mark.parametrize("jaw", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("smile", [0.0, 0.5])
def test_the_mirror_finds_a_face_that_gives_the_measured_angles(jaw: float, smile: float) -> None:
    product = channel("jawOpen * (0.5 + 0.5 * mouthFunnel)", name="a")
    other = channel("0.8 * mouthFunnel if jawOpen > 0.5 else mouthFunnel ** 2", name="b", id=2)
    table = build_table([product, other], P)
    angles, _ = table.angles(face(jawOpen=jaw, mouthFunnel=smile))
    found = Mirror(table, P).read(angles)
    assert np.degrees(table.angles(found)[0] - angles) == pytest.approx([0.0, 0.0], abs=0.5)


def test_one_thing_only_is_followed() -> None:
    with pytest.raises(ValueError, match="one of mix, formula and anchor"):
        channel("jawOpen", mix={"jawOpen": 1.0})
