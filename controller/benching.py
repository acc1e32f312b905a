"""What ``omote bench`` measures: the shipped head's own engine, part by part and as a whole."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from controller.paths import find_config


def median_ms(work: Callable[[], object], seconds: float) -> float:
    """Median time of ``work`` over ``seconds`` (at least five calls), after one call that is not counted."""
    work()
    times: list[float] = []
    end = time.perf_counter() + seconds
    while len(times) < 5 or time.perf_counter() < end:
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1e3 * float(np.median(times))


def head_rows(name: str, seconds: float, tell: Callable[[str], None]) -> Iterator[tuple[str, ...]]:
    """Rows of the head table: posing with everything, one region and nothing changing."""
    from surface.head import Head

    started = time.perf_counter()
    head = Head.load(find_config("heads", name))
    loading = 1e3 * (time.perf_counter() - started)
    vertices = sum(len(part.vertices) for part in head.parts)
    yield ("load and tessellate", f"{loading:.0f}", "", f"{len(head.parts)} parts, {vertices} vertices")
    rng = np.random.default_rng(1)
    count = len(head.parameters)
    full = _poser(head, [rng.uniform(0, 0.5, count) for _ in range(16)])
    tell("the whole head")
    whole = median_ms(full, seconds)
    yield ("pose, every parameter changed", f"{whole:.2f}", "1", "numerators anew, positions and exact normals")
    for parameter in ("jawOpen", "eyeBlinkLeft", "browInnerUp"):
        tell(parameter)
        took = median_ms(_poser(head, _one_moving(head.parameters.index(parameter), count)), seconds)
        yield (f"pose, only {parameter} changed", f"{took:.2f}", f"{took / whole:.2f}", "only what it reaches")
    still = median_ms(_poser(head, [np.zeros(count)]), seconds)
    yield ("pose, nothing changed", f"{still:.3f}", f"{still / whole:.3f}", "")


def _one_moving(index: int, count: int) -> list[NDArray[np.float64]]:
    poses = [np.zeros(count) for _ in range(8)]
    for k, pose in enumerate(poses):
        pose[index] = k / len(poses)
    return poses


def _poser(head: object, poses: list[NDArray[np.float64]]) -> Callable[[], object]:
    state = {"next": 0}

    def step() -> None:
        head.pose(poses[state["next"] % len(poses)])  # type: ignore[attr-defined]
        state["next"] += 1

    return step
