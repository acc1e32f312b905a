"""``omote run``, ``play`` and ``demo``: a report as rows, and runs from the command line."""

from __future__ import annotations

from controller.cli.run import report_rows

SPREAD = {"mean": 1.0, "p50": 1.0, "p95": 2.0, "p99": 3.25, "max": 4.0}
FACE = {
    "frames": 300,
    "seconds": 10.0,
    "frames_per_second": 30.0,
    "frames_with_motion": 299,
    "frame_ms": SPREAD,
    "size": [1280, 720],
    "quality": "full",
    "renderer": "llvmpipe",
    "start_to_first_frame_s": 2.5,
}
LOOP = {"rate_hz": 49.98, "wanted_hz": 50.0, "ticks": 500, "skipped": 2, "jitter_ms": SPREAD}


def test_every_part_of_a_run_has_its_rows() -> None:
    bus = {
        "name": "head",
        "servos": 24,
        **LOOP,
        "command_to_wire_ms": {},
        "channels_held_at_limit": 3,
        "bus": {"errors": {"no_reply": 2}, "limits_hit": 4},
    }
    link = {"port": "/dev/x", "accepted": 7, "refused": {"E_NAME": 1}}
    found = dict(report_rows({"stage": "s", "face": FACE, "control": LOOP, "links": [link], "buses": [bus]}))
    assert found["frames per second"] == "30.0"
    assert found["milliseconds a frame"] == "p50 1.00  p95 2.00  p99 3.25  max 4.00"
    assert found["start to first frame"] == "2.50 s"
    assert found["link /dev/x"] == "7 lines accepted, 1 refused"
    assert found["bus head: 24 servos"] == "50.0 Hz of 50 wanted, 2 skipped"
    assert found["bus head: command to wire (ms)"] == "nothing measured"
    assert found["bus head: errors"] == "2 no_reply"
    assert found["bus head: targets held at a limit"] == "7"


def test_a_stage_without_body_or_robots_still_reports_its_face() -> None:
    assert dict(report_rows({"stage": "s", "face": FACE}))["frames"] == "300 in 10.0 s, 299 of them with motion"
