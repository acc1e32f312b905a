"""Checks of model names: which of the known models omote drives, and in which family."""

from __future__ import annotations

from drivers.base.errors import DriverError
from drivers.tables.tables import FEETECH, ControlTable, known_models, load_table, model_number


def check_dynamixel(model: str) -> None:
    """Check that a name is a Dynamixel of either protocol that omote drives; raises DriverError for any other."""
    table = load_table(model)
    check_driven(table)
    if table.model.startswith(FEETECH):
        raise DriverError(
            f"servo model {model!r} is no Dynamixel",
            hint='set the kind of its bus to the family it is of, as "feetech"; omote plugins lists them',
        )


def check_feetech(model: str) -> None:
    """Check that a name is a Feetech model that omote drives; raises DriverError for any other."""
    known = known_models()
    try:
        name = known[model_number(model)]
    except DriverError:
        name = ""
    if not name.startswith(FEETECH):
        driven = sorted(each for each in known.values() if each.startswith(FEETECH) and load_table(each).driven)
        raise DriverError(f"servo model {model!r} is no Feetech known here", hint=f"use one of {', '.join(driven)}")
    check_driven(load_table(name))


def check_driven(table: ControlTable) -> None:
    """Raises DriverError for a model whose registers are known, but which omote does not drive."""
    if not table.driven:
        hint = "omote scan and omote monitor --listen know its registers"
        raise DriverError(f"{table.model} is not driven by omote yet", hint=hint)
