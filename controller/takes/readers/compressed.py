"""Defines the reader of voices in compressed files."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="compressed",
    title="a voice, by ffmpeg",
    suffixes=(".mp3", ".ogg", ".oga", ".opus", ".m4a", ".aac", ".flac", ".webm"),
    read="controller.takes.compressed:compressed_take",
    layer="speech",
)
