"""Defines the reader of the numbers of visemes that Azure's speech synthesis reports."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="azure_visemes",
    title="visemes of Azure speech",
    suffixes=(".json",),
    read="controller.takes.azure:viseme_take",
    layer="speech",
    recognises="controller.takes.azure:is_visemes",
)
