"""Defines the reader of TextGrid files of Praat and of the Montreal Forced Aligner."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="textgrid",
    title="TextGrid of Praat or MFA",
    suffixes=(".textgrid",),
    read="controller.takes.aligned:textgrid_take",
    layer="speech",
)
