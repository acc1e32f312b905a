"""Saves where a point of the skin was pulled to as the anchor of a servo, in a robot file of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tomli_w

from controller.base.errors import ParameterError
from controller.base.files import replacing
from controller.base.parameters import Floats, Parameters
from controller.robot.robot import load_robot

_MIN_MOVE_MM = 1.0
_REACH_MM, _SWING_DEG = 25.0, 30.0


def save_anchor(path: Path, name: str, place: Floats, pull: Floats, parameters: Parameters) -> None:
    """Write a robot of one simulated servo that pulls at a point of the skin, as far as the point was pulled.

    path : the file, which must not be there. place : (3,) mm, the point at rest. pull : (3,) mm.

    Raises ParameterError: the point was hardly pulled, or there is such a file. ControllerError: it cannot be written.
    """
    far_mm = float(np.linalg.norm(pull))
    if far_mm < _MIN_MOVE_MM:
        raise ParameterError("no point was pulled", hint="Ctrl and drag the point where the servo pulls")
    if path.exists():
        raise ParameterError(f"{path}: there is such a file already", hint="choose another name")
    direction = [round(float(x), 3) for x in pull / far_mm]
    table = {
        "name": name,
        "buses": [{"name": "head", "kind": "simulated"}],
        "landmarks": {name: [round(float(x), 2) for x in place]},
        "channels": [
            {
                "name": name, "bus": "head", "id": 1, "model": "xl330-m288",
                "anchor": {"point": name, "direction": direction, "reach_mm": _REACH_MM},
                "map": {"at": [0.0, round(far_mm, 2)], "deg": [0.0, _SWING_DEG]},
                "limit_deg": [-5.0, _SWING_DEG + 5.0], "max_speed_deg_s": 300.0, "max_accel_deg_s2": 3000.0,
            }
        ],
    }  # fmt: skip
    with replacing(path) as temporary:
        temporary.write_text(
            "# Where a servo pulls; copy the landmark and the anchor into your robot.\n" + tomli_w.dumps(table),
            encoding="utf-8",
        )
        load_robot(temporary, parameters)
