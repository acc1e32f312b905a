"""Defines the reader of the output of aeneas."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="aeneas",
    title="aeneas",
    suffixes=(".json",),
    read="controller.takes.aligned:aeneas_take",
    layer="speech",
    recognises="controller.takes.aligned:is_aeneas",
)
