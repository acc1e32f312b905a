"""Which servo models each family drives."""

from __future__ import annotations

from drivers.errors import DriverError


def check_dynamixel(model: str) -> None:
    """A Dynamixel model that speaks Protocol 2.0; raises DriverError for any other."""
    from drivers.dynamixel.tables import load_table, model_number

    table = load_table(model_number(model))
    if table.protocol != 2:
        raise DriverError(
            f"servo model {model!r} does not speak Dynamixel Protocol 2.0",
            hint='set the kind of its bus to the family it is of, as "feetech"; docs/drivers.md lists them',
        )
