"""Defines the reader of action units of py-feat."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="pyfeat",
    title="action units of py-feat",
    suffixes=(".csv",),
    read="controller.takes.action_units:pyfeat_take",
    recognises="controller.takes.action_units:is_pyfeat",
)
