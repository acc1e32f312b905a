"""Defines the reader of WAV files of voices."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="wav",
    title="a voice",
    suffixes=(".wav",),
    read="controller.takes.voice:wav_take",
    layer="speech",
)
