"""Defines the reader of plain tables of parameters."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="plain",
    title="a table of time,jawOpen,...",
    suffixes=(".csv",),
    read="controller.takes.plain:plain_take",
)
