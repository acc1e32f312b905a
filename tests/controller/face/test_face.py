"""The face's side of a run: values in the head's order, pictures kept along the way, frames counted."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.clock import Clock
from controller.base.errors import ControllerError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS
from controller.face.face import FrameLog, HeadlessFace, HeadValues, Recorder, head_indices, process_age_s
from controller.stage.stage import FaceSettings
from surface.head import Head, save_data
from tests.surface.small_head import small_head


def test_values_come_in_the_heads_order() -> None:
    with Mailbox.create(len(PARAMETERS.names)) as mailbox:
        values = HeadValues(mailbox, PARAMETERS, ("jawOpen", "unheardOf", "headYaw"))
        mailbox.publish(np.linspace(0.0, 1.0, len(PARAMETERS.names)), 7)
        jaw, yaw = (PARAMETERS.index(name) / (len(PARAMETERS.names) - 1) for name in ("jawOpen", "headYaw"))
        assert values() == pytest.approx([jaw, 0.0, yaw])


def test_a_recorder_keeps_the_middle_at_its_own_rate() -> None:
    recorder = Recorder(clip_hz=10.0, height=4)
    picture = np.zeros((8, 16, 3), dtype=np.uint8)
    picture[:, 4:12] = 200  # the middle square
    kept = [t for t in np.arange(0.0, 1.0, 0.03) if recorder.wants(t) and recorder.keep(picture, t) is None]
    assert len(kept) == 10
    assert np.diff(kept).min() > 0.05
    assert recorder.frames[0].shape == (4, 4, 3)
    assert (recorder.frames[0] == 200).all()


def test_a_long_recording_keeps_all_of_its_time_in_no_more_pictures() -> None:
    recorder, picture = Recorder(clip_hz=10.0, height=4, most=16), np.zeros((4, 4, 3), dtype=np.uint8)
    for t in np.arange(0.0, 20.0, 0.05):
        if recorder.wants(t):
            recorder.keep(picture, t)
    assert 8 <= len(recorder.frames) <= 17 and len(recorder.times_s) == len(recorder.frames)
    assert recorder.times_s[0] == 0.0 and recorder.times_s[-1] > 18.0
    assert np.diff(recorder.times_s) == pytest.approx(1 / recorder.clip_hz, abs=0.06)


def test_a_folder_for_pictures_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    recorder = Recorder()
    recorder.keep(np.zeros((4, 4, 3), dtype=np.uint8), 0.0)
    (tmp_path / "file").touch()
    with pytest.raises(ControllerError, match=r"file: cannot be made: File exists") as told:
        recorder.write(tmp_path / "file")
    assert told.value.hint


def test_frames_with_motion_are_counted() -> None:
    log = FrameLog()
    for k, value in enumerate([0.0, 0.0, 1.0, 1.0, 2.0]):
        log.add(np.array([value]), k * 20_000_000, k * 20_000_000 + 5_000_000)
    report = log.report(FaceSettings(), "llvmpipe")
    assert report["frames"] == 5
    assert report["frames_with_motion"] == 2
    assert report["seconds"] == pytest.approx(0.085)
    assert report["frame_ms"]["p50"] == pytest.approx(5.0)  # type: ignore[index]


def test_unknown_names_stay_zero_whatever_the_mailbox_holds() -> None:
    names = PARAMETERS.names
    with Mailbox.create(len(names)) as mailbox:
        values = HeadValues(mailbox, PARAMETERS, (names[-1], "unheardOf", names[0]))
        assert values.full.shape == (len(names),) and values.values.tolist() == [0.0] * 3
        for level in (0.25, 0.75):
            mailbox.publish(np.full(len(names), level), 7)
            assert values().tolist() == [level, 0.0, level] and values() is values.values
            assert (values.full == level).all()
    assert head_indices(PARAMETERS, ("x", names[1])).tolist() == [len(names), 1]


def test_a_kept_picture_is_the_mean_of_squares_of_the_middle() -> None:
    recorder = Recorder(height=2)
    picture = np.arange(6 * 10 * 3, dtype=np.uint8).reshape(6, 10, 3)
    recorder.keep(picture, 0.0)
    square = picture[:, 2:8].astype(float).reshape(2, 3, 2, 3, 3)
    np.testing.assert_array_equal(recorder.frames[0], np.floor(square.mean(axis=(1, 3))))
    tall = np.zeros((9, 4, 3), np.uint8)
    tall[2:6] = 255
    recorder = Recorder(height=100)
    recorder.keep(tall, 0.0)
    assert recorder.frames[0].shape == (4, 4, 3) and (recorder.frames[0] == 255).all()
    recorder = Recorder(height=2)
    recorder.keep(np.full((5, 5, 3), 255, np.uint8), 0.0)
    assert recorder.frames[0].shape == (2, 2, 3) and (recorder.frames[0] == 255).all()


def test_pictures_are_due_on_a_grid() -> None:
    recorder = Recorder(clip_hz=4.0, height=4)
    picture = np.zeros((4, 4, 3), np.uint8)
    assert recorder.wants(0.0)
    recorder.keep(picture, 0.1)
    assert not recorder.wants(0.24) and recorder.wants(0.25)
    recorder.keep(picture, 0.25)
    assert not recorder.wants(0.49) and recorder.wants(0.5)
    recorder.keep(picture, 1.1)  # late
    assert not recorder.wants(1.24) and recorder.wants(1.25)
    assert recorder.times_s == [0.1, 0.25, 1.1]
    usual = Recorder()
    assert (usual.clip_hz, usual.height, usual._most) == (12.5, 360, 400)


def test_more_pictures_than_there_is_room_for_are_thinned_out() -> None:
    recorder, picture = Recorder(clip_hz=8.0, height=4, most=4), np.zeros((4, 4, 3), np.uint8)
    for i in range(4):
        recorder.keep(picture, i / 8)
    assert len(recorder.frames) == 4 and recorder.clip_hz == 8.0
    recorder.keep(picture, 0.5)
    assert recorder.times_s == [0.0, 0.25, 0.5] and recorder.clip_hz == 4.0 and len(recorder.frames) == 3
    assert not recorder.wants(0.74) and recorder.wants(0.75)


def test_a_sheet_shows_twelve_moments_of_the_whole_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: dict[str, Any] = {}
    monkeypatch.setattr(
        "surface.view.pictures.sheet.compose",
        lambda pictures, labels, *, columns: written.update(pictures=pictures, labels=labels, columns=columns),
    )
    monkeypatch.setattr("surface.view.pictures.sheet.write_png", lambda page, out: written.update(sheet=out))
    monkeypatch.setattr(
        "surface.view.pictures.clip.write_clip",
        lambda frames, out, *, fps: written.update(frames=len(frames), clip=out, fps=fps),
    )
    recorder = Recorder(clip_hz=10.0, height=4)
    assert recorder.write(tmp_path / "none") == [] and not (tmp_path / "none").exists()
    for i in range(34):
        recorder.keep(np.full((4, 4, 3), i, np.uint8), i / 10)
    folder = tmp_path / "a" / "b"
    assert recorder.write(folder) == [str(folder / "sheet.png"), str(folder / "face.webp")]
    assert [int(picture[0, 0, 0]) for picture in written["pictures"]] == list(range(0, 34, 3))
    assert written["labels"] == [f"{i / 10:.1f} s" for i in range(0, 34, 3)]
    assert (written["columns"], written["frames"], written["fps"]) == (4, 34, 10.0)
    assert (written["sheet"], written["clip"]) == (folder / "sheet.png", folder / "face.webp")
    short = Recorder(height=4)
    for i in range(3):
        short.keep(np.full((4, 4, 3), i, np.uint8), i / 10)
    short.write(folder)
    assert [int(picture[0, 0, 0]) for picture in written["pictures"]] == [0, 1, 2]


def test_a_log_of_frames_is_exact(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("controller.face.face.process_age_s", lambda: 2.5)
    log, settings = FrameLog(), FaceSettings(size=(64, 32), quality="fast")
    empty = log.report(settings, "x")
    assert (empty["frames"], empty["seconds"], empty["frames_per_second"], empty["frame_ms"]) == (0, 0.0, 0.0, {})
    assert empty["start_to_first_frame_s"] == 0.0
    values = np.array([0.0, 1.0])
    for k in range(4):
        values[0] = k // 2  # the log has to keep a copy
        began = 10**9 + k * 250_000_000
        log.add(values, began, began + 125_000_000, 10**9 - 75_000_000 if k < 3 else began + 25_000_000)
    found = log.report(settings, "x")
    assert found == {
        "frames": 4, "seconds": 0.875, "frames_per_second": 4 / 0.875, "frames_with_motion": 1,
        "frame_ms": dict.fromkeys(("mean", "p50", "p95", "p99", "max"), 125.0), "start_to_first_frame_s": 2.5,
        "command_to_picture_ms": {"mean": 150.0, "p50": 150.0, "p95": 195.0, "p99": 199.0, "max": 200.0},
        "size": [64, 32], "quality": "fast", "renderer": "x",
    }  # fmt: skip


def test_the_age_of_a_process_is_that_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = os.sysconf("SC_CLK_TCK")
    fields = ["S", *(str(i) for i in range(1, 19)), str(5 * ticks), *(str(i) for i in range(20, 50))]
    texts = {"/proc/self/stat": f"17 (a ) b) {' '.join(fields)}\n", "/proc/uptime": "12.5 99.0\n"}
    monkeypatch.setattr(Path, "read_text", lambda path: texts[str(path)])
    assert process_age_s() == 7.5
    texts["/proc/uptime"] = "x"
    assert process_age_s() == 0.0
    texts["/proc/self/stat"] = "17"
    assert process_age_s() == 0.0

    def missing(path: Path) -> str:
        raise FileNotFoundError(path)

    monkeypatch.setattr(Path, "read_text", missing)
    assert process_age_s() == 0.0


def test_pictures_are_kept_at_the_time_since_the_run_began(tmp_path: Path) -> None:
    save_data(tmp_path, small_head())
    head, recorder = Head.load(tmp_path), Recorder(clip_hz=1000.0)
    settings = FaceSettings(size=(64, 64), fps=60, evaluator="cpu")
    face = HeadlessFace(head, settings, lambda: np.zeros(len(head.parameters)), recorder)
    rounds = iter([True, True, True, False])
    try:
        face.run(lambda: next(rounds))
    finally:
        face.close()
    assert 0.0 <= recorder.times_s[0] < 60.0 and recorder.times_s == sorted(recorder.times_s)
    assert len(recorder.times_s) == 3


def test_a_picture_that_took_too_long_is_followed_by_the_next_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 10 frames a second, a frame of 250 ms: nothing waits for the end of the third period."""
    now_ns, began = [0], list[int]()

    def sleep(seconds: float) -> None:
        now_ns[0] += round(seconds * 1e9)

    class Fake(Clock):
        def __init__(self, rate_hz: float, *, prompt: bool = False) -> None:
            super().__init__(rate_hz, now_ns=lambda: now_ns[0], sleep_s=sleep, prompt=prompt)

    def values() -> np.ndarray:
        began.append(now_ns[0])
        now_ns[0] += 250_000_000 if len(began) == 2 else 1_000_000
        return np.zeros(len(head.parameters))

    monkeypatch.setattr("controller.face.face.Clock", Fake)
    save_data(tmp_path, small_head())
    head = Head.load(tmp_path)
    face = HeadlessFace(head, FaceSettings(size=(32, 32), fps=10, evaluator="cpu"), values)
    rounds = iter([True] * 4 + [False])
    try:
        face.run(lambda: next(rounds))
    finally:
        face.close()
    assert began == [0, 100_000_000, 350_000_000, 450_000_000]


def test_breath_and_pupils_of_the_mailbox_are_those_of_the_values() -> None:
    with Mailbox.create(len(PARAMETERS.names)) as mailbox:
        values = HeadValues(mailbox, PARAMETERS, ("jawOpen",))
        mailbox.publish(PARAMETERS.neutral(), 7, (1.5, 0.1))
        assert values.life == (0.0, 0.0)
        values()
        assert values.life == (1.5, 0.1)


def test_a_face_without_a_display_breathes_as_its_values_say(tmp_path: Path) -> None:
    save_data(tmp_path, small_head())
    head, rounds, seen = Head.load(tmp_path), iter([True, True, False]), list[tuple[float, float]]()
    with Mailbox.create(len(PARAMETERS.names)) as mailbox:

        def keep_going() -> bool:
            seen.append((head.rise_mm, head.pupil))
            mailbox.publish(PARAMETERS.neutral(), 0, (1.0 + len(seen), 0.05))
            return next(rounds)

        values = HeadValues(mailbox, PARAMETERS, head.parameters)
        face = HeadlessFace(head, FaceSettings(size=(32, 32), fps=60, evaluator="cpu"), values)
        try:
            face.run(keep_going)
        finally:
            face.close()
    assert seen == [(0.0, 0.0), (2.0, 0.05), (3.0, 0.05)]
