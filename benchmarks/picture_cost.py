"""What a frame of the picture costs, material by material, beside a bare fill of the same pixels.

Run ``python benchmarks/picture_cost.py [--quality fast] [--size 1280x720]``. Each row draws the same pose again and
again and says milliseconds a frame: on the clock, of the processor in all its threads, and of the thread that calls
OpenGL. Rows that leave something out say, by their difference from the first, what that costs. Times are from one run
on one machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from controller.base.paths import find_config
from controller.stage.stage import find_persons, load_head
from surface.head import Head
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.bounds import Bands
from surface.view.scene.camera import Camera

FRAMES = 40
Times = tuple[float, float, float]


def timed(work: Callable[[], object], frames: int | None = None) -> Times:
    """Milliseconds a call: clock, processor, this thread; the least of three rounds by the processor's."""
    rounds, frames = [], frames or FRAMES
    for _ in range(3):
        began = time.process_time(), time.perf_counter(), time.thread_time()
        for _ in range(frames):
            work()
        ended = time.process_time(), time.perf_counter(), time.thread_time()
        rounds.append(tuple(1e3 * (b - a) / frames for a, b in zip(began, ended, strict=True)))
    cpu, clock, own = min(rounds)
    return clock, cpu, own


class Bench:
    """A head at one pose, drawn again and again."""

    def __init__(self, quality: str, size: tuple[int, int], person: str = "") -> None:
        folder = find_config("heads", "ict")
        self.head: Head = load_head(folder, {}, (), find_persons(person, folder))
        self.screen = Offscreen(self.head, size, quality=quality)
        self.values = np.full(len(self.head.parameters), 0.2)
        self.screen.draw(self.values)
        self.screen.draw(self.values)  # the first makes the live target
        self.screen.finish()
        self.renderer, self.target, self.camera = self.screen.renderer, self.screen.target, Camera.front()
        self.parts = list(self.renderer._parts)
        self.bands = self.renderer.region(self.camera, self.target._drawn.size)

    def draw(self, leave_out: str = "", bands: Bands | None = None) -> None:
        """One frame without the parts of a material, and wait for it."""
        self.renderer._parts = [p for p in self.parts if p.part.material != leave_out and leave_out != "everything"]
        self.renderer.draw(self.camera, self.target._drawn, bands or self.bands)
        self.target._flush.clear()
        self.screen.ctx.finish()
        self.renderer._parts = self.parts

    def smooth(self) -> None:
        """What comes after a frame: smoothing, and enlarging where it was drawn smaller."""
        self.target._pending = self.bands
        self.target.complete()
        self.screen.ctx.finish()

    def pixels(self) -> dict[str, int]:
        """Pixels that pass the depth test, by part."""
        query, draw, found = self.screen.ctx.query(samples=True), self.renderer._draw_part, {}
        self.draw("everything")
        for buffers in self.parts:
            with query:
                draw(buffers, multisampled=self.target.samples > 1)
            found[buffers.part.name] = query.samples
        return found

    def rows(self) -> list[tuple[str, Times]]:
        """Every measurement."""
        materials = sorted({p.part.material for p in self.parts})
        whole = Bands.whole(self.target._drawn.size)
        return [
            ("drawing, all", timed(self.draw)),
            *((f"drawing without {name}", timed(lambda name=name: self.draw(name))) for name in materials),
            ("bare fill: the background where the head is", timed(lambda: self.draw("everything"))),
            ("bare fill: the background everywhere", timed(lambda: self.draw("everything", whole))),
            ("smoothing the edges", timed(self.smooth)),
            ("finding the bands", timed(lambda: self.renderer.region(self.camera, self.target._drawn.size))),
            ("posing, every parameter", timed(self.poser())),
        ]

    def poser(self) -> Callable[[], None]:
        """A call that poses what is drawn of the head differently each time."""
        random = np.random.default_rng(1)

        def pose() -> None:
            self.renderer.evaluator.pose(random.uniform(0.0, 0.5, len(self.values)))

        return pose


def ratio(one: Bench, other: Bench, rounds: int = 9) -> str:
    """Processor time of a whole frame (posing, drawing, smoothing, bands) of one head over that of another: median of
    rounds in which both are measured one after the other."""

    def frame(bench: Bench) -> Callable[[], None]:
        pose = bench.poser()

        def work() -> None:
            pose()
            bench.renderer.update()
            bench.draw("", bench.renderer.region(bench.camera, bench.target._drawn.size))
            bench.smooth()

        return work

    works, found = (frame(one), frame(other)), []
    for _ in range(rounds):
        times = []
        for bench, work in zip((one, other), works, strict=True):
            bench.screen._make_current()
            times.append(timed(work, 10)[1])
        found.append(times)
    middle = sorted(found, key=lambda pair: pair[0] / pair[1])[rounds // 2]
    return f"{middle[0]:.2f} ms against {middle[1]:.2f} ms a frame: {middle[0] / middle[1]:.3f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print; ``arguments`` : in place of the command line's."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quality", default="full", choices=("full", "fast"))
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--person", default="", help="a name of configs/persons, with hair and clothes")
    parser.add_argument("--beside", help="another person, or none, drawn in turn with the first: prints only the ratio")
    given = parser.parse_args(arguments)
    width, height = (int(number) for number in given.size.split("x"))
    bench, console = Bench(given.quality, (width, height), given.person), Console(highlight=False)
    if given.beside is not None:
        other = Bench(given.quality, (width, height), given.beside.replace("none", ""))
        console.print(ratio(bench, other))
        return
    table = Table(f"{given.quality}, {given.size}", "clock ms", "processor ms", "OpenGL's thread ms")
    for name, times in bench.rows():
        table.add_row(name, *(f"{t:.2f}" for t in times))
    console.print(table)
    found = bench.pixels()
    triangles = sum(len(p.triangles) for p in bench.parts)
    console.print(f"{sum(found.values())} pixels of {triangles} triangles; {bench.screen.ctx.info['GL_RENDERER']}")
    console.print("  ".join(f"{name} {count}" for name, count in found.items()))
    bench.screen.close()


if __name__ == "__main__":
    main()
