"""Defines the reader of results of MediaPipe's face landmarker."""

from controller.takes.reader import TakeReader

TAKE = TakeReader(
    api=1,
    kind="mediapipe",
    title="results of MediaPipe's face landmarker",
    suffixes=(".json", ".jsonl"),
    read="controller.takes.mediapipe:mediapipe_take",
    recognises="controller.takes.mediapipe:is_mediapipe",
)
