"""Which servo models each family drives."""

from __future__ import annotations

from drivers.base.errors import DriverError
from drivers.tables.tables import known_models, load_table, model_number

FEETECH = ("sts", "sm", "scs")
"""What the names of Feetech's models begin with."""


def check_dynamixel(model: str) -> None:
    """A Dynamixel model of either protocol; raises DriverError for any other."""
    table = load_table(model_number(model))
    if table.model.startswith(FEETECH):
        raise DriverError(
            f"servo model {model!r} is no Dynamixel",
            hint='set the kind of its bus to the family it is of, as "feetech"; docs/drivers.md lists them',
        )


def check_feetech(model: str) -> None:
    """A Feetech model; raises DriverError for any other."""
    known = known_models()
    ours = sorted(name for name in known.values() if name.startswith(FEETECH))
    try:
        name = known[model_number(model)]
    except DriverError:
        name = ""
    if name not in ours:
        raise DriverError(f"servo model {model!r} is no Feetech known here", hint=f"use one of {', '.join(ours)}")
