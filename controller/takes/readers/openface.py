"""Defines the reader of action units of OpenFace."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="openface",
    title="action units of OpenFace 2",
    suffixes=(".csv",),
    read="controller.takes.action_units:openface_take",
    recognises="controller.takes.action_units:is_openface",
)
