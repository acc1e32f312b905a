"""Defines the reader of timed sounds and of the output of Rhubarb Lip Sync."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="sounds",
    title="Rhubarb Lip Sync, or timed phonemes or visemes",
    suffixes=(".tsv", ".json"),
    read="controller.takes.speech:cue_take",
    layer="speech",
)
