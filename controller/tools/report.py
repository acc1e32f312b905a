"""Formats a run's report as rows of a table."""

from __future__ import annotations

from typing import Any


def rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and value of the most important entries of a run's report."""
    face = report.get("face")
    return [*(_face(face) if face else []), *_control(report), *_buses(report.get("buses", []))]


def _face(face: dict[str, Any]) -> list[tuple[str, str]]:
    width, height = face["size"]
    found = [
        ("picture", f"{width} x {height}, {face['quality']}, {face['renderer']}"),
        ("frames", f"{face['frames']} in {face['seconds']:.1f} s, {face['frames_with_motion']} of them with motion"),
        ("frames per second", f"{face['frames_per_second']:.1f}"),
        ("milliseconds a frame", _spread(face["frame_ms"])),
    ]
    if report_start := face.get("start_to_first_frame_s"):
        found.append(("start to first frame", f"{report_start:.2f} s"))
    return found


def _control(report: dict[str, Any]) -> list[tuple[str, str]]:
    found = []
    if control := report.get("control"):
        found.append(("control loop", _loop(control)))
    if take := report.get("take"):
        rate = f"{take['rows']} rows at {take['rate_hz']:.0f} Hz"
        found.append(("take", f"{take['played_s']:.1f} of {take['duration_s']:.1f} s played, {rate}"))
    if voice := report.get("voice"):
        found.append(("voice", f"{voice['heard_s']:.1f} s heard"))
    return found + [
        (f"link {link['port']}", f"{link['accepted']} lines accepted, {sum(link['refused'].values())} refused")
        for link in report.get("links", [])
    ]


def _buses(buses: list[dict[str, Any]]) -> list[tuple[str, str]]:
    found = []
    for bus in buses:
        name = f"bus {bus['name']}"
        errors = ", ".join(f"{count} {kind}" for kind, count in bus["bus"]["errors"].items()) or "none"
        found += [
            (f"{name}: {bus['servos']} servos", _loop(bus)),
            (f"{name}: jitter (ms)", _spread(bus["jitter_ms"])),
            (f"{name}: command to wire (ms)", _spread(bus["command_to_wire_ms"])),
            (f"{name}: errors", errors),
            (f"{name}: targets held at a limit", str(bus["channels_held_at_limit"] + bus["bus"]["limits_hit"])),
        ]
        if away := bus.get("face_difference"):
            worst = away["worst"][0]
            text = f"rms {away['rms_deg']:.1f} deg, most at {worst['channel']}: rms {worst['rms_deg']:.1f} deg"
            found.append((f"{name}: measured face is away from the wanted one by", text))
            by_region = "  ".join(f"{region} {rms:.1f}" for region, rms in away.get("regions_rms_deg", {}).items())
            found.append((f"{name}: by region (rms deg)", by_region))
        for rule in bus.get("rules", []):
            found.append((f"{name}: rule", f"{rule['rule']}: {rule['times']} times, {rule['seconds']:.1f} s"))
    return found


def _loop(loop: dict[str, Any]) -> str:
    return f"{loop['rate_hz']:.1f} Hz of {loop['wanted_hz']:g} wanted, {loop['skipped']} skipped"


def _spread(summary: dict[str, float]) -> str:
    if not summary:
        return "nothing measured"
    return "  ".join(f"{key} {summary[key]:.2f}" for key in ("p50", "p95", "p99", "max"))
