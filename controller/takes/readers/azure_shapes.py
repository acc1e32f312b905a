"""Defines the reader of the blend shapes that Azure's speech synthesis reports."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="azure_shapes",
    title="blend shapes of Azure speech",
    suffixes=(".json",),
    read="controller.takes.azure:blend_shape_take",
    recognises="controller.takes.azure:is_blend_shapes",
)
