"""Draws the heads of a stage side by side: a wall of pictures, each head as its own person.

Heads that look alike share one surface and are posed in one batch (:class:`surface.head.Crowd`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from controller.base.clock import Clock
from controller.base.mailboxes import Mailbox
from controller.base.parameters import Floats, Parameters
from controller.face.face import FrameLog, Image, Recorder, head_indices
from controller.stage.stage import FaceSettings, Stage, heads_of
from surface.head import Crowd, Head
from surface.head.model.parameters import head_angles
from surface.view.pictures.offscreen import Offscreen
from surface.view.pictures.sheet import zoom_to_head
from surface.view.scene.camera import Camera
from surface.view.scene.framing import framed

_ASPECT = 0.8
"""Width divided by height of the tile that a head with its shoulders fills best."""


def grid(count: int, size: tuple[int, int]) -> tuple[int, int]:
    """Return columns and rows of ``count`` tiles in a picture of a size (pixels), so that the heads are largest."""
    width, height = size

    def head_height(columns: int) -> float:
        rows = -(-count // columns)
        return min(width / columns / _ASPECT, height / rows)

    columns = max(range(1, count + 1), key=head_height)
    return columns, -(-count // columns)


@dataclass
class _Alike:
    """Heads that look alike.

    order : index of each of the head's parameters in the full vector. places : positions of the heads in the stage.
    crowd : poses the heads in one batch; None for a single one.
    """

    head: Head
    camera: Camera
    order: np.ndarray
    places: list[int] = field(default_factory=list)
    crowd: Crowd | None = None
    screen: Offscreen | None = None

    def begin(self, tile: tuple[int, int], face: FaceSettings, first: Offscreen | None) -> Offscreen:
        """Open and return the screen that draws the heads, in the OpenGL context of the first screen."""
        if len(self.places) > 1:
            self.crowd = Crowd(self.head, len(self.places))
        self.screen = Offscreen(
            self.head, tile, quality=face.still_quality, theme=face.make_theme(),
            evaluator="cpu" if self.crowd is not None else face.evaluator, ctx=None if first is None else first.ctx,
        )  # fmt: skip
        return self.screen

    def draw(self, rows: Floats, time_s: float, lives: Floats) -> None:
        """Draw a frame of a single head without reading it back; does nothing for a crowd."""
        if self.crowd is None and self.screen is not None:
            values = self._select(rows)[0]
            self.head.sway.advance(head_angles(values), time_s)
            self.head.live(*lives[0].tolist())
            self.screen.draw(values, self.camera)

    def pictures(self, rows: Floats, lives: Floats, time_s: float | None, *, drawn: bool) -> list[Image]:
        """Return one picture for each head; ``rows`` : (h, P) values, ``lives`` : (h, 2). time_s : until when hair
        sways; None: it stays. drawn : whether :meth:`draw` has drawn them."""
        assert self.screen is not None
        values = self._select(rows)
        if self.crowd is None:
            if time_s is not None:
                self.head.sway.advance(head_angles(values[0]), time_s)
            self.head.live(*lives[0].tolist())
            return [self.screen.read() if drawn else self.screen.render(values[0], self.camera)]
        self.crowd.pose(values, lives)
        found = []
        for k in range(len(self.crowd)):
            self.crowd.show(k)
            found.append(self.screen.render_present(self.camera, values[k]))
        return found

    def _select(self, rows: Floats) -> Floats:
        """Return the values (h, p) in the head's order; 0 for names that omote does not know."""
        return np.hstack([rows, np.zeros((len(rows), 1))])[:, self.order]


@dataclass
class LoadedHead:
    """A head of a wall. stage : of the first head that looks so. order : (h,) its parameters' indices in full vectors.
    places : numbers in the stage of all heads that look like it."""

    head: Head
    stage: Stage
    order: np.ndarray
    places: list[int] = field(default_factory=list)

    def camera(self, tile: tuple[int, int]) -> Camera:
        """A camera that shows the head whole in a tile of a size, pixels."""
        narrow = min(1.0, tile[0] / tile[1] / _ASPECT)
        face = self.stage.settings.face
        return zoom_to_head(framed(face.make_camera(), self.head, worn=face.dressed)).zoom(narrow)


def load_heads(
    stages: Sequence[Stage], parameters: Parameters, wanted: Callable[[], bool] = lambda: True
) -> list[LoadedHead]:
    """Load the heads of a stage, one for all that look alike; those left out that come after ``wanted`` is False.

    stages : of each head, as if it were the only one. Raises SurfaceError: a head cannot be read.
    """
    found: dict[object, LoadedHead] = {}
    for i, stage in enumerate(stages):
        look = _look_key(stage)
        if look not in found:
            if not wanted():
                break
            head = stage.load_head()
            found[look] = LoadedHead(head, stage, head_indices(parameters, head.parameters))
        found[look].places.append(i)
    return list(found.values())


class Wall:
    """The heads of a stage, each in a tile of one picture; a context manager.

    stage : one with ``[[heads]]``. size : of the whole, pixels.

    Attributes
    ----------
    names : of the heads, in the order of the stage file. columns : number of tiles in a row. tile : width and height of
    a tile (pixels).

    Raises SurfaceError: a head cannot be read. ViewError: OpenGL is missing.
    """

    def __init__(self, stage: Stage, parameters: Parameters, size: tuple[int, int]) -> None:
        stages, face = heads_of(stage), stage.settings.face
        self.names = tuple(head.name for head in stage.heads)
        self.columns, rows = grid(len(stages), size)
        self.tile = max(16, size[0] // self.columns), max(16, size[1] // rows)
        loaded = load_heads(stages, parameters)
        self._alike = [_Alike(each.head, each.camera(self.tile), each.order, each.places) for each in loaded]
        self._closers, first = ExitStack(), None
        for alike in self._alike:
            screen = self._closers.enter_context(alike.begin(self.tile, face, first))
            first = first or screen
        assert first is not None
        self.renderer = first.ctx.info["GL_RENDERER"]

    def draw(self, rows: Floats, time_s: float, lives: Floats | None = None) -> None:
        """Draw a frame of the heads that look like no other; the others are drawn by :meth:`pictures`.

        rows : (n, P) full parameter vectors, in the order of the stage. lives : (n, 2) breath and pupils of each, see
        :meth:`surface.head.Head.live`; None: at rest.
        """
        beside = np.zeros((len(rows), 2)) if lives is None else lives
        for alike in self._alike:
            alike.draw(rows[alike.places], time_s, beside[alike.places])

    def pictures(
        self, rows: Floats, lives: Floats | None = None, time_s: float | None = None, *, drawn: bool = False
    ) -> list[Image]:
        """Return a picture (h, w, 3) uint8 of each head, in the order of the stage file.

        rows, lives : as :meth:`draw`. time_s : until when the hair of heads that look like no other sways; None: it
        stays. drawn : whether :meth:`draw` has drawn this frame.
        """
        found: dict[int, Image] = {}
        beside = np.zeros((len(rows), 2)) if lives is None else lives
        for alike in self._alike:
            places = alike.places
            found.update(zip(places, alike.pictures(rows[places], beside[places], time_s, drawn=drawn), strict=True))
        return [found[i] for i in range(len(rows))]

    @property
    def crowded(self) -> bool:
        """Whether some heads look alike, so that :meth:`draw` does not draw all of them."""
        return any(alike.crowd is not None for alike in self._alike)

    def join(self, pictures: Sequence[Image]) -> Image:
        """Join the pictures of the heads into one, (h, w, 3) uint8."""
        missing = -len(pictures) % self.columns
        filled = [*pictures, *[np.zeros_like(pictures[0])] * missing]
        return np.vstack([np.hstack(filled[i : i + self.columns]) for i in range(0, len(filled), self.columns)])

    def close(self) -> None:
        """Free the graphics memory."""
        self._closers.close()

    def __enter__(self) -> Wall:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class WallFace:
    """Draws frame after frame of all heads without a display, like :class:`controller.face.face.HeadlessFace`.

    mailboxes : of the heads, in the order of the stage file. Raises: see :class:`Wall`.
    """

    def __init__(
        self, stage: Stage, parameters: Parameters, mailboxes: Sequence[Mailbox], recorder: Recorder | None = None
    ) -> None:
        self._settings, self._mailboxes, self._recorder = stage.settings.face, mailboxes, recorder
        self._wall = Wall(stage, parameters, self._settings.size)
        self._rows = np.zeros((len(mailboxes), len(parameters)))
        self._log = FrameLog()
        self._wall.draw(self._rows, 0.0)  # loads code before the first frame is timed

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Draw while ``keep_going()`` returns True, at most ``fps`` times a second."""
        started = time.monotonic_ns()
        for now in Clock(self._settings.fps, prompt=True).run(keep_going):
            stamps = [mailbox.read(row)[1] for mailbox, row in zip(self._mailboxes, self._rows, strict=True)]
            time_s = (now - started) / 1e9
            lives = np.array([mailbox.life for mailbox in self._mailboxes])
            self._wall.draw(self._rows, time_s, lives)
            if self._recorder is not None and self._recorder.wants(time_s):
                self._recorder.keep(self._wall.join(self._wall.pictures(self._rows, lives, drawn=True)), time_s)
            elif self._wall.crowded:
                self._wall.pictures(self._rows, lives, drawn=True)
            self._log.add(self._rows, now, time.monotonic_ns(), max(stamps))

    def close(self) -> None:
        """Free the graphics memory."""
        self._wall.close()

    def report(self) -> dict[str, object]:
        """Return the statistics of the frames; see :meth:`controller.face.face.FrameLog.report`."""
        return {**self._log.report(self._settings, self._wall.renderer), "heads": list(self._wall.names)}


def _look_key(stage: Stage) -> object:
    """Return a key that is equal for stages whose heads look alike."""
    identity = tuple(sorted(stage.settings.identity.items()))
    return stage.head, identity, stage.groups, tuple((person.path, share) for person, share in stage.persons)
