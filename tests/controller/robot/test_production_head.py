"""A production head's own configuration: its shape keys as parameters, its formulas, its neck, its recorded pairs.

For development: it runs where ``OMOTE_HANSON_HEAD`` names a checkout of Hanson Robotics' repository HEAD, whose files
are read there and are no part of omote. ``-s`` prints the errors.
"""

from __future__ import annotations

import csv
import importlib.util
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.base.parameters import PARAMETERS, Parameters
from controller.cli.app import make_app
from controller.robot.channels import build_table
from controller.robot.linkages.rods import Rods
from controller.robot.pairs.fit import fit_servo
from controller.robot.robot import load_robot
from controller.robot.settings import ChannelSettings

_US_PER_DEG = 10.0
_MIDDLE_US = 1500.0


@pytest.fixture(scope="module")
def head() -> Path:
    found = os.environ.get("OMOTE_HANSON_HEAD")
    if not found or not (Path(found) / "src" / "tools" / "scripts").is_dir():
        pytest.skip("OMOTE_HANSON_HEAD names no checkout of hansonrobotics/HEAD")
    return Path(found)


def tell(text: str) -> None:
    sys.stdout.write(f"{text}\n")


def name_of(key: str) -> str:
    """A shape key as the name of a parameter."""
    return "key_" + re.sub(r"[^A-Za-z0-9]+", "_", key)  # some are names of ARKit, too


def read(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


def own_parameters(keys: list[str], folder: Path) -> Parameters:
    lines = [f'[parameters.{name_of(key)}]\nprofile = "mouth"\nregion = "mouth"\n' for key in keys]
    (folder / "keys.toml").write_text("\n".join(lines))
    return PARAMETERS.with_files([folder / "keys.toml"])


def motors(path: Path) -> dict[str, dict[str, Any]]:
    """Name, range in microseconds, formula and shape keys of the motors that follow weighted sums of shape keys."""
    found = {}
    for name, block in re.findall(r"^(\S+):\n((?:[ -].*\n)+)", path.read_text(encoding="utf-8"), re.MULTILINE):
        keys = re.search(r"name: fsshapekey, shapekey: (\S+?)\}", block)
        start = re.search(r"imin: (\S+)\n\s+name: weightedsum", block)
        terms = re.findall(r"\{imax: (\S+), max: (\S+), min: (\S+)\}", block)
        ends = [re.search(rf"^  {key}: (\S+)$", block, re.MULTILINE) for key in ("min", "max")]
        if keys and start and terms and all(ends):
            low, high = (float(end[1]) for end in ends if end)
            shapes = keys[1].split(";")[: len(terms)]
            found[name] = {"low": low, "high": high, "imin": float(start[1]), "keys": shapes,
                           "terms": [tuple(map(float, term)) for term in terms[: len(shapes)]]}  # fmt: skip
    return found


def their_us(motor: dict[str, Any], values: dict[str, float]) -> float:
    """The weighted sum as the head's own mapper adds it up."""
    total = motor["imin"]
    for (imax, most, least), key in zip(motor["terms"], motor["keys"], strict=True):
        share = min(max(values[key], min(least, most)), max(least, most)) - least
        total += share * (imax - motor["imin"]) / (most - least)
    return float(motor["low"] + total * (motor["high"] - motor["low"]))


def as_formula(motor: dict[str, Any]) -> str:
    parts = [repr(motor["imin"])]
    for (imax, most, least), key in zip(motor["terms"], motor["keys"], strict=True):
        ends = sorted((least, most))
        parts.append(f"(clamp({name_of(key)}, {ends[0]!r}, {ends[1]!r}) - {least!r}) * "
                     f"({imax!r} - {motor['imin']!r}) / ({most!r} - {least!r})")  # fmt: skip
    return " + ".join(parts)


def channel(name: str, number: int, motor: dict[str, Any]) -> ChannelSettings:
    low, high = ((motor[end] - _MIDDLE_US) / _US_PER_DEG for end in ("low", "high"))
    return ChannelSettings.model_validate({
        "name": name, "bus": "b", "id": number, "model": "rc-180", "formula": as_formula(motor),
        "map": {"at": [0, 1], "deg": [low, high]}, "limit_deg": (low, high), "max_speed_deg_s": 300,
        "max_accel_deg_s2": 3000,
    })  # fmt: skip


def test_its_own_formulas_over_parameters_of_its_own(head: Path, tmp_path: Path) -> None:
    keys, frames = read(head / "src/tools/scripts/shkey_frame_data.csv")
    own = own_parameters(keys, tmp_path)
    known = {key.lower(): key for key in keys}
    found = {}
    for name, motor in motors(head / "scripts/robots_config/robot/pololu.yaml").items():
        motor["keys"] = [known.get(key.lower(), key) for key in motor["keys"]]
        if all(key in keys for key in motor["keys"]):
            found[name] = motor
    assert len(found) >= 10 and len(own.own) == len(keys)
    table = build_table([channel(name, i + 1, motor) for i, (name, motor) in enumerate(found.items())], own)
    worst = 0.0
    for row in frames:
        values = own.neutral()
        values[own.indices(map(name_of, keys))] = row
        sent = np.degrees(table.angles(values)[0]) * _US_PER_DEG + _MIDDLE_US
        given = dict(zip(keys, row, strict=True))
        wanted = np.array([their_us(motor, given) for motor in found.values()])
        inside = np.clip(wanted, [m["low"] for m in found.values()], [m["high"] for m in found.values()])
        worst = max(worst, float(np.abs(sent - inside).max()))
    tell(f"\n{len(found)} servos, {len(keys)} shape keys, {len(frames)} frames: {worst:.2e} us at most")
    assert worst < 0.005


@pytest.fixture(scope="module")
def their_neck(head: Path) -> Callable[[float, float], tuple[float, float]]:
    path = head / "src/hardware/pau2motors/src/pau2motors/NeckKinematics.py"
    spec = importlib.util.spec_from_file_location("their_neck_kinematics", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    neck = module.lower_neck()

    def angles(theta: float, phi: float) -> tuple[float, float]:
        neck.inverse_kinematics(theta, phi)
        return float(np.degrees(neck.theta_l)), float(np.degrees(neck.theta_r))

    return angles


def neck_of_rods() -> Rods:
    """The same neck by its drawing's dimensions; theirs: x forward, y left, z up; omote's: x left, y up, z forward."""
    rest, arm = 0.41528994045450957, 13.0
    plate = np.array([[-47.68, -12.65, 38.27], [47.68, -12.65, 38.27]])
    axle = np.array([[-34.2, -57.35, 40.0], [34.2, -57.35, 40.0]])
    horn = arm * np.array([[-np.cos(rest), -np.sin(rest), 0.0], [np.cos(rest), -np.sin(rest), 0.0]])
    return Rods.of(("pitch", "roll"), plate, axle, horn, np.array([[0.0, 0.0, 1.0]] * 2))


def test_its_two_servo_neck_is_a_linkage_and_no_linear_mix(their_neck: Callable[..., Any]) -> None:
    rods, rng = neck_of_rods(), np.random.default_rng(1)
    poses, theirs = [], []
    for _ in range(400):
        theta, phi = rng.uniform(0.0, np.radians(18.0)), rng.uniform(-np.pi, np.pi)
        try:
            theirs.append(their_neck(theta, phi))
        except OverflowError:
            continue
        up = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]  # where the stem points
        roll = -np.arcsin(up[1])
        poses.append(np.degrees([np.arctan2(up[0], up[2]), roll]))
    given, wanted = np.array(poses), np.array(theirs)
    ours = np.array([rods.angles(pose)[0] for pose in given])
    design = np.column_stack([given, np.ones(len(given))])
    linear = design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
    rms, most = (lambda away: np.sqrt((away**2).mean())), (lambda away: np.abs(away).max())
    tell(f"\n{len(given)} poses: linear mix {rms(linear - wanted):.2f} deg rms, {most(linear - wanted):.2f} at most; "
          f"linkage {rms(ours - wanted):.1e} rms, {most(ours - wanted):.1e} at most")  # fmt: skip
    assert len(given) > 250
    assert most(ours - wanted) < 1e-6
    assert most(linear - wanted) > 1.0


def test_its_recorded_pairs_by_the_command(head: Path, tmp_path: Path) -> None:
    """``omote calibrate --pairs`` writes channels that send what was recorded, as closely as its table says."""
    keys, values = read(head / "src/tools/scripts/pau_data.csv")
    names, quarters = read(head / "src/tools/scripts/serial_port_data.csv")
    deg = (quarters / 4.0 - _MIDDLE_US) / _US_PER_DEG
    own = own_parameters(keys, tmp_path)
    columns = [*map(name_of, keys), *(f"servos:{name}" for name in names)]
    np.savetxt(tmp_path / "pairs.csv", np.hstack([values, deg]), delimiter=",", header=",".join(columns), comments="")
    lines = ['name = "production"', 'vocabularies = ["keys.toml"]', "[[buses]]", 'name = "b"', 'kind = "simulated"']
    lines.append('simulates = "maestro"')
    for number, name in enumerate(names):
        lines += ["[[channels]]", f'name = "{name}"', 'bus = "b"', f"id = {number}", 'model = "rc-180"']
        lines += ["mix = { jawOpen = 1 }", "map = { at = [0, 1], deg = [0, 1] }", "limit_deg = [-88, 88]"]
        lines += ["max_speed_deg_s = 300", "max_accel_deg_s2 = 3000"]
    (tmp_path / "robot.toml").write_text("\n".join(lines))
    words = ["calibrate", str(tmp_path / "robot.toml"), "--pairs", str(tmp_path / "pairs.csv")]
    said = CliRunner().invoke(make_app(), words)
    assert said.exit_code == 0, said.output
    robot = load_robot(tmp_path / "robot.toml", PARAMETERS)
    table, at = build_table(robot.channels, own), own.indices(map(name_of, keys))
    sent = []
    for row in values:
        face = own.neutral()
        face[at] = row
        sent.append(np.degrees(table.angles(face)[0]))
    moving = np.flatnonzero(np.ptp(deg, axis=0) > 0.0)
    away = _US_PER_DEG * np.sqrt(((np.array(sent) - deg) ** 2).mean(axis=0))
    spans = _US_PER_DEG * np.ptp(deg, axis=0)
    shares = away[moving] / spans[moving]
    tell(f"\n{len(moving)} of {len(names)} servos move in {len(deg)} pairs: {away[moving].max():.2f} us rms at most, "
         f"{100 * np.median(shares):.2f} % of its way in the median, {100 * shares.max():.2f} % at most")  # fmt: skip
    assert len(moving) == 14
    assert (shares < 0.01).all()


def test_a_fit_to_its_recorded_pairs(head: Path, tmp_path: Path) -> None:
    keys, values = read(head / "src/tools/scripts/pau_data.csv")
    names, quarters = read(head / "src/tools/scripts/serial_port_data.csv")
    us = quarters / 4.0
    for i, name in enumerate(names):
        fit = fit_servo(values, (us[:, i] - _MIDDLE_US) / _US_PER_DEG)
        spans, error, left_out = (x * _US_PER_DEG for x in (fit.span_deg, fit.rms_deg, fit.left_out_deg))
        used = ", ".join(keys[term.parameter] for term in fit.terms)
        tell(f"{name:22s} moves {spans:6.1f} us, error {error:5.2f}, left out {left_out:6.2f}  {used}  {fit.why_not}")
        assert fit.why_not or error < 0.05 * spans + 1.0
