"""Plays and scrubs a timeline or a take (a recorded performance) by holding the face of the current moment.

Independent of the window library.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.base.errors import ControllerError, ParameterError
from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.body.messages import HoldAll, PanelRequest
from controller.panels.session.commands import Commands
from controller.panels.session.sound import SoundPlayer, sound_length_s
from controller.takes.edit import cut_out, keep, layer_over, smooth
from controller.takes.livelink import Take
from controller.takes.plain import write_plain
from controller.takes.reader import load_take
from controller.takes.timeline import Ease, key_of_face, load_timeline, save_show
from controller.vocabulary.vocabulary import Vocabulary

_MIN_LENGTH_S = 1.0
"""Length at which shorter timelines are drawn."""
JITTER_S = 0.05


class Playback:
    """Shows moments, and edits the timeline at the line; called once per frame.

    newest : the newest parameters (P,). send : sends requests to the body. clock : seconds.
    parameters : default: those of the base vocabulary. sound : plays the timeline's sound.

    Attributes
    ----------
    position_s : the current moment. playing : whether it advances. selected : the number of a key; None for none.
    range_s : the marked part of a take.
    """

    def __init__(
        self, commands: Commands, newest: Callable[[], Floats], send: Callable[[PanelRequest], None],
        clock: Callable[[], float] = time.monotonic, parameters: Parameters | None = None,
        sound: SoundPlayer | None = None,
    ) -> None:  # fmt: skip
        self._sound = sound or SoundPlayer()
        self._commands, self._newest, self._send, self._clock = commands, newest, send, clock
        self._parameters = parameters or PARAMETERS
        self.position_s, self.playing = 0.0, False
        self.selected: int | None = None
        self.range_s: tuple[float, float] | None = None
        self._last_s = clock()
        self._held: tuple[int, ...] = ()
        self._measured: tuple[Path | None, float] = (None, 0.0)

    @property
    def length_s(self) -> float:
        """Length of what is played."""
        take, timeline = self._commands.now.take, self._commands.now.timeline
        if take is not None:
            return take.duration_s
        return max(timeline.length_s, 0.0 if timeline.sound is None else self._sound_length_s(timeline.sound))

    def _sound_length_s(self, path: Path) -> float:
        if path != self._measured[0]:
            try:
                self._measured = path, sound_length_s(path)
            except ControllerError:  # playing reports it; reporting it again in every frame would be of no use
                self._measured = path, 0.0
        return self._measured[1]

    @property
    def shown_s(self) -> float:
        """Length of the scale that is drawn."""
        return max(self.length_s * 1.1, _MIN_LENGTH_S)

    def __call__(self) -> None:
        """Let the line go on while it plays; it stops at the end."""
        now_s = self._clock()
        step_s, self._last_s = now_s - self._last_s, now_s
        if not self.playing:
            return
        self.position_s = min(self.position_s + step_s, self.length_s)
        self._show()
        if self.position_s >= self.length_s:
            self.stop()

    def toggle(self) -> None:
        """Play from the line on, or stop there; at the end it begins again.

        Raises ControllerError: its sound cannot be played; the face is played nevertheless.
        """
        if self.playing:
            self._pause()
        elif self.length_s > 0.0:
            self.position_s = 0.0 if self.position_s >= self.length_s else self.position_s
            self.playing = True
            now = self._commands.now
            if now.take is None and now.timeline.sound is not None:
                self._sound.start(now.timeline.sound, self.position_s)

    def _pause(self) -> None:
        self.playing = False
        self._sound.stop()

    def scrub(self, position_s: float) -> None:
        """Put the line somewhere and show the face there."""
        self._pause()
        self.position_s = min(max(position_s, 0.0), self.shown_s)
        self._show()

    def stop(self) -> None:
        """Stop, and give back what was held."""
        self._pause()
        if self._held:
            self._send(HoldAll(self._held, None))
        self._held = ()

    def close(self) -> None:
        """The window is closed: no sound goes on."""
        self._pause()

    def _show(self) -> None:
        now, names = self._commands.now, self._parameters.names
        if now.take is not None:
            face, used = now.take.sample(self.position_s, self._parameters.neutral()), np.flatnonzero(now.take.mask)
        else:
            face = now.timeline.at(self.position_s, self._parameters)
            used = np.array([i for i, n in enumerate(names) if any(n in key.values for key in now.timeline.keys)], int)
        self._held = tuple(map(int, used))
        if self._held:
            self._send(HoldAll(self._held, tuple(float(face[i]) for i in used)))

    def add_key(self, ease: Ease, name: str = "", face: Floats | None = None) -> None:
        """Put a face, the present one without, on the timeline at the line."""
        timeline = self._commands.now.timeline
        key = key_of_face(self.position_s, self._newest() if face is None else face, self._parameters, ease, name)
        self._commands.set_timeline(timeline.with_key(key))
        self.selected = next(i for i, each in enumerate(self._commands.now.timeline.keys) if each.at_s == key.at_s)

    def delete_key(self) -> None:
        """Take the selected key away."""
        if self.selected is not None:
            self._commands.set_timeline(self._commands.now.timeline.without_key(self.selected))
            self.selected = None

    def move_key(self, number: int, at_s: float) -> None:
        """Move a key, as one step of a drag; it keeps its place among the others."""
        keys = self._commands.now.timeline.keys
        low = keys[number - 1].at_s + 0.01 if number else 0.0
        high = keys[number + 1].at_s - 0.01 if number + 1 < len(keys) else np.inf
        at_s = round(min(max(at_s, low), high), 3)
        self._commands.set_timeline(self._commands.now.timeline.with_time(number, at_s), ("key", number))

    def edit(self, take: Take | None) -> None:
        """Edit a recording; the keys of the timeline for None."""
        self._pause()
        self._commands.set_take(take)
        self.position_s, self.range_s, self.selected = 0.0, None, None

    def edit_take(self, how: str) -> None:
        """``keep`` or ``cut`` the marked range, or ``smooth`` all. Raises ParameterError: nothing is marked."""
        take = self._commands.now.take
        if take is None:
            raise ParameterError("there is no recording to edit", hint="R records")
        if how == "smooth":
            self._commands.set_take(smooth(take, JITTER_S))
            return
        if self.range_s is None:
            raise ParameterError("no range of the recording is marked", hint="drag over it with the right mouse button")
        self._commands.set_take((keep if how == "keep" else cut_out)(take, *self.range_s))
        self.range_s, self.position_s = None, 0.0

    def layer(self, above: Take) -> None:
        """Lay a recording over the one that is edited, from the line on. Raises ParameterError: none is edited."""
        take = self._commands.now.take
        if take is None:
            raise ParameterError("there is no recording to lay another one over", hint="edit the recording first")
        self._commands.set_take(layer_over(take, above, min(self.position_s, take.duration_s)))

    def hear(self, path: Path | None) -> None:
        """Play a sound with the timeline, or none. Raises ControllerError: it is none that can be played."""
        if path is not None:
            sound_length_s(path)
        self._commands.set_timeline(replace(self._commands.now.timeline, sound=path))

    def load(self, path: Path) -> None:
        """Edit what a file holds: a show that was made here, a take, or the lips of a voice.

        Raises ParameterError: a show that has no keys. ControllerError: the file cannot be read.
        """
        if path.suffix == ".toml":
            timeline = load_timeline(path, self._parameters)
            if not timeline.keys:
                raise ParameterError(f"{path}: is a show without keys", hint="load one that was saved here")
            self._commands.change(replace(self._commands.now, timeline=timeline, take=None))
        else:
            self.edit(load_take(path, self._parameters))
        self.position_s, self.selected, self.range_s = 0.0, None, None

    def save(self, folder: Path, name: str, vocabulary: Vocabulary, *, loop: bool) -> Path:
        """Write the recording as a take, or the timeline as a show; returns the file.

        Raises ParameterError, ControllerError: there is nothing to write, or no such folder.
        """
        now = self._commands.now
        stem = Path(name.strip() or "mine").name
        if now.take is not None:
            path = folder / f"{stem}.csv"
            write_plain(path, now.take.times_s, now.take.values, now.take.mask, self._parameters)
        else:
            path = folder / f"{stem}.toml"
            save_show(path, now.timeline, self._parameters, vocabulary, loop=loop)
        return path
