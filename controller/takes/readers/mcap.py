"""Defines the reader of takes in MCAP files."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="mcap",
    title="a face in MCAP, as JSON messages",
    suffixes=(".mcap",),
    read="controller.takes.mcap_files:mcap_take",
    install="omote[mcap]",
)
