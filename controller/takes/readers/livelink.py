"""Defines the reader of takes of Live Link Face."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="livelink",
    title="Live Link Face",
    suffixes=(".csv",),
    read="controller.takes.livelink:Take.load",
    recognises="controller.takes.livelink:is_livelink",
)
