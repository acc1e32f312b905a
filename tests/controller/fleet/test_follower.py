"""controller.fleet.follower: exactly what a conductor sends, one's own life without it, and no jump between."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.fleet.follower import Follower
from controller.fleet.lease import Token
from controller.fleet.payload import Header
from controller.layers.commands import CommandState

DT, STEP_NS = 0.01, 10**7
FIRST, SECOND = Token(1, 5), Token(2, 3)


class Faces:
    """A conductor's faces: one that changes its expression now and then, by the real layers."""

    def __init__(self, seed: int, token: Token) -> None:
        self.state, self.token, self.sequence = CommandState(P, seed=seed), token, 0
        self.state.live(1.0, 0)
        self._names = ("happiness", "anger", "surprise", "sadness")

    def next(self, now_ns: int, dt: float = DT) -> tuple[Header, np.ndarray]:
        if self.sequence % 90 == 0:
            self.state.expression(self._names[self.sequence // 90 % 4], 1.0, None, now_ns)
            self.state.gaze(0.4 * (-1) ** (self.sequence // 90), 0.1, now_ns)
        self.sequence += 1
        values = P.neutral()
        self.state.tick(now_ns, dt, values)
        return Header(self.token, self.sequence, now_ns, now_ns), values


def play(follower: Follower, spans: list[tuple[Faces | None, float]]) -> tuple[np.ndarray, list[np.ndarray | None]]:
    """What is shown, (n, P), and what was sent in each tick."""
    own, now_ns, mine = CommandState(P, seed=99), 10**9, P.neutral()
    own.live(1.0, 0)
    shown, sent = [], []
    for faces, seconds in spans:
        for _ in range(round(seconds / DT)):
            now_ns += STEP_NS
            own.tick(now_ns, DT, mine)
            values = None
            if faces is not None:
                header, values = faces.next(now_ns)
                follower.take(header, values)
            out = P.neutral()
            follower.step(now_ns, DT, mine, out)
            shown.append(out)
            sent.append(values)
    return np.array(shown), sent


def check_limits(shown: np.ndarray, dt: float = DT) -> None:
    """Every step of ``dt`` s within the limits of speed, and of acceleration, but for rounding."""
    speed = np.diff(shown, axis=0) / dt
    assert (np.abs(speed) <= P.max_speed * 1.000001).all()
    acceleration = np.diff(speed, axis=0) / dt
    over = np.abs(acceleration) / P.max_acceleration
    assert over.max() < 1.000001, P.names[int(np.unravel_index(over.argmax(), over.shape)[1])]


def test_what_is_sent_is_shown_bit_for_bit() -> None:
    shown, sent = play(Follower(P), [(Faces(1, FIRST), 2.0)])
    np.testing.assert_array_equal(shown, np.array(sent))


def test_a_head_that_loses_its_conductor_goes_over_to_its_own_life_and_back_without_a_jump() -> None:
    follower, faces = Follower(P, patience_s=0.4), Faces(1, FIRST)
    shown, sent = play(follower, [(faces, 1.5), (None, 4.0), (faces, 4.0)])
    check_limits(shown)
    waits = shown[165:185]
    assert np.abs(waits - shown[149]).max() < 1e-3  # so long only, where it was when it heard the last face
    moves = np.abs(np.diff(shown[195:550], axis=0)).max(axis=1)
    assert (moves > 0.0).mean() > 0.9
    assert follower.exact and np.array_equal(shown[-1], sent[-1])
    late = [np.array_equal(a, b) for a, b in zip(shown[-200:], sent[-200:], strict=True)]
    assert all(late)  # in step again within two seconds


def test_another_conductor_takes_over_without_a_jump_and_the_old_one_is_not_obeyed_again() -> None:
    follower, old, new = Follower(P), Faces(1, FIRST), Faces(2, SECOND)
    shown, _ = play(follower, [(old, 1.5), (None, 0.3), (new, 3.0)])
    check_limits(shown)
    refused = [follower.take(*old.next(9 * 10**9 + k * STEP_NS)) for k in range(5)]
    assert not any(refused) and sum(follower.refused.values()) == 5 and follower.highest == SECOND


def test_old_and_repeated_faces_are_refused() -> None:
    follower, faces = Follower(P), Faces(1, FIRST)
    one, two = faces.next(10**9), faces.next(10**9 + STEP_NS)
    assert follower.take(*two) and not follower.take(*one) and not follower.take(*two)
    assert follower.refused == {"older than the last one": 2}


def test_faces_wait_until_they_are_due_by_the_conductors_clock() -> None:
    follower = Follower(P, delay_ns=50 * 10**6)
    follower.offset_ns = 10**12  # the conductor's clock is ahead
    values = P.neutral()
    values[P.index("jawOpen")] = 0.5
    out = P.neutral()
    follower.take(Header(FIRST, 1, 10**12 + 10**9), values)
    follower.step(10**9 + 49 * 10**6, DT, P.neutral(), out)
    assert not follower.conducted and out[P.index("jawOpen")] == 0.0
    follower.step(10**9 + 50 * 10**6, DT, P.neutral(), out)
    assert follower.conducted


@pytest.mark.parametrize("delay_ms", [0.0, 120.0])
def test_faces_that_are_late_or_lost_bend_the_motion_and_no_more(delay_ms: float) -> None:
    rng, follower, faces = np.random.default_rng(5), Follower(P, delay_ns=round(delay_ms * 1e6)), Faces(1, FIRST)
    waiting: list[tuple[int, Header, np.ndarray]] = []
    shown, sent, own, last = [], [], P.neutral(), 0
    for k in range(1, 700):
        now_ns, out = 10**9 + k * STEP_NS, P.neutral()
        header, values = faces.next(now_ns)
        sent.append(values)
        if k >= 600 or rng.random() > 0.05:
            due = now_ns + round(rng.uniform(30e6, 70e6) if k < 600 else 50e6)
            last = max(due, last)  # Zenoh keeps the order of what it sends
            waiting.append((last, header, values))
        for each in sorted((each for each in waiting if each[0] <= now_ns), key=lambda each: each[0]):
            follower.take(*each[1:])
            waiting.remove(each)
        follower.step(now_ns, DT, own, out)
        shown.append(out)
    check_limits(np.array(shown))
    late = round((delay_ms or 50.0) / 10.0)
    assert follower.exact and np.array_equal(shown[-1], sent[-1 - late])
    if delay_ms:  # nothing but what was lost is missing: all else is shown in its turn
        same = [np.array_equal(a, b) for a, b in zip(shown[late:], sent[:-late], strict=True)]
        assert np.mean(same[100:]) > 0.88  # it has joined by then; 5 % are lost


def test_after_a_gap_the_face_goes_on_within_its_limits() -> None:
    follower, faces = Follower(P), Faces(1, FIRST)
    shown, _ = play(follower, [(faces, 1.0)])
    for k in range(40):  # 0.4 s that nobody hears of
        faces.next(10**9 + (101 + k) * STEP_NS)
    now, own, rows = 10**9 + 141 * STEP_NS, P.neutral(), [shown[-2], shown[-1]]
    for k in range(200):
        header, values = faces.next(now + k * STEP_NS)
        follower.take(header, values)
        out = P.neutral()
        follower.step(now + k * STEP_NS, DT, own, out)
        rows.append(out)
    check_limits(np.array(rows))
    assert follower.exact


def test_who_conducts_itself_shows_its_own_face_from_where_it_was() -> None:
    follower, faces = Follower(P), Faces(1, FIRST)
    own, out = P.neutral(), P.neutral()
    for k in range(1, 60):
        follower.take(*faces.next(k * STEP_NS))
        follower.step(k * STEP_NS, DT, own, out)
    before = out.copy()
    follower.lead(SECOND)
    rows = [before]
    for k in range(60, 400):
        follower.step(k * STEP_NS, DT, own, out)
        rows.append(out.copy())
    assert not follower.conducted and np.array_equal(rows[-1], own)
    assert np.abs(rows[1] - before).max() < P.max_speed.max() * DT
    with pytest.raises(AssertionError):
        check_limits(np.array([before, own, own]))  # a jump would be seen


def test_a_head_that_looks_the_other_way_has_joined_after_two_seconds() -> None:
    """The greatest gap there is, from one end of the head's turn to the other; within the limits all the way."""
    follower, yaw = Follower(P), P.index("headYaw")
    own, theirs, rows = P.neutral(), P.neutral(), []
    own[yaw], theirs[yaw] = -1.0, 1.0
    for k in range(250):
        now_ns, out = 10**9 + k * STEP_NS, P.neutral()
        if k >= 50:
            follower.take(Header(FIRST, k, now_ns), theirs)
        follower.step(now_ns, DT, own, out)
        rows.append(out)
    assert follower.exact and rows[-1][yaw] == 1.0
    check_limits(np.array(rows))


@pytest.mark.parametrize("lost_ms", [60, 300])
def test_a_face_that_moves_all_the_time_is_shown_exactly_again_soon_after_every_gap(lost_ms: int) -> None:
    """A filter that lags would have to wait until nothing accelerates any more: 2.3 s, and on a busy machine longer."""
    rng, follower, faces = np.random.default_rng(7), Follower(P), Faces(1, FIRST)
    now_ns, waits, out = 10**9, [], P.neutral()
    for gap in range(41):
        for k in range(int(rng.integers(90, 150))):
            now_ns += STEP_NS
            follower.take(*faces.next(now_ns))
            follower.step(now_ns, DT, P.neutral(), out)
            if gap and follower.exact and len(waits) < gap:
                waits.append(k * DT)
        assert len(waits) == gap or not gap
        for _ in range(lost_ms // 10):
            now_ns += STEP_NS
            faces.next(now_ns)
            follower.step(now_ns, DT, P.neutral(), out)
    assert max(waits) < 0.8


def test_a_slow_conductor_is_followed_within_the_limits_and_now_and_then_exactly() -> None:
    """Its faces come at every eighth tick; the head does not leap with each of them."""
    follower, faces, slow = Follower(P), Faces(1, FIRST), 8
    own, out, exact, rows = P.neutral(), P.neutral(), list[bool](), list[np.ndarray]()
    for k in range(8, 800):
        if k % slow == 0:
            follower.take(*faces.next(k * STEP_NS))
        follower.step(k * STEP_NS, DT, own, out)
        exact.append(follower.exact and follower.conducted)
        rows.append(out.copy())
    check_limits(np.array(rows))
    spans = np.array(exact[: -(len(exact) % 200)]).reshape(-1, 200)
    assert spans.any(axis=1).all() and not all(exact)


def test_faces_that_were_lost_are_bridged_where_the_next_one_waits() -> None:
    """With a delay it is known where the face goes; the head moves on to there and is exact again at once."""
    late_ns = 8 * STEP_NS
    follower, faces = Follower(P, delay_ns=late_ns), Faces(1, FIRST)
    own, out, exact, rows = P.neutral(), P.neutral(), list[bool](), list[np.ndarray]()
    lost = range(200, 400, 10)
    for k in range(1, 420):
        header, values = faces.next(k * STEP_NS)
        if k not in lost:
            follower.take(header, values)
        follower.step(k * STEP_NS, DT, own, out)
        exact.append(follower.exact and follower.conducted)
        rows.append(out.copy())
    shown = np.array(rows)
    check_limits(shown[9:])
    at = np.array(lost) + 8 - 1  # the tick that would show a lost face
    assert not any(exact[k] for k in at)
    assert np.mean([exact[k + 1] for k in at]) > 0.8
    moved = np.abs(np.diff(shown, axis=0)).max(axis=1)
    assert (moved[at - 1] > 0.0).mean() > 0.9


def test_a_head_is_as_far_in_its_motion_as_its_conductor_where_their_ticks_differ_a_little() -> None:
    """Else every tick that is a little shorter than the conductor's would be too fast for the limits."""
    rng, follower, faces = np.random.default_rng(4), Follower(P), Faces(1, FIRST)
    exact, own, out = list[bool](), P.neutral(), P.neutral()
    for k in range(1, 600):
        follower.take(*faces.next(k * STEP_NS))
        follower.step(k * STEP_NS, DT + rng.uniform(-4e-3, 4e-3), own, out)
        exact.append(follower.exact and follower.conducted)
    assert all(exact)


@pytest.mark.parametrize("rate_hz", [250, 1000])
def test_the_limits_hold_where_a_face_is_lost_and_ticks_are_as_short_as_they_may_be(rate_hz: int) -> None:
    """Two short ticks of the conductor are not taken for one of the head's that came a little late."""
    step_ns, dt, rows = round(1e9 / rate_hz), 1.0 / rate_hz, list[np.ndarray]()
    follower, faces, own, out = Follower(P), Faces(1, FIRST), P.neutral(), P.neutral()
    for k in range(1, 3 * rate_hz):
        header, values = faces.next(k * step_ns, dt)
        if k % 20 >= rate_hz // 250:
            follower.take(header, values)
        follower.step(k * step_ns, dt, own, out)
        rows.append(out.copy())
    assert np.abs(np.diff(rows, axis=0)).max() > 0.0
    check_limits(np.array(rows), dt)


def test_a_bridge_ends_at_the_next_face_also_where_that_came_just_now_and_late() -> None:
    """Faces come in another thread, so one may come that is due after the tick has looked for those."""
    follower, jaw, out = Follower(P, delay_ns=5 * STEP_NS), P.index("jawOpen"), P.neutral()
    near, far = P.neutral(), P.neutral()
    near[jaw], far[jaw] = 0.1, 0.2
    follower.take(Header(FIRST, 1, 10**9), near)
    follower.step(10**9 + 5 * STEP_NS, DT, P.neutral(), out)
    follower.take(Header(FIRST, 3, 10**9 + 2 * STEP_NS), far)
    follower._bridge(10**9 + 4 * STEP_NS)
    assert np.array_equal(follower._followed, far) and follower._followed_ns == 10**9 + 2 * STEP_NS


def test_own_life_is_not_needed_while_a_conductor_is_followed_whether_or_not_its_face_is_met() -> None:
    follower, own, out = Follower(P, 0.5), P.neutral(), P.neutral()
    far = P.neutral()
    far[P.index("jawOpen")] = 1.0
    assert not follower.follows(0.0)
    for k in range(1, 4):
        follower.take(Header(FIRST, k, k * STEP_NS, 0), far if k > 1 else P.neutral())
        follower.step(k * STEP_NS, DT, own, out)
    assert follower.conducted and not follower.exact
    assert follower.follows(3 * DT) and not follower.follows(3 * DT + 0.6)


@pytest.mark.parametrize(("yaw_rad", "limit"), [(0.3, "acceleration"), (1.0, "speed")])
def test_a_turn_to_a_conductor_is_as_quick_as_six_tenths_of_the_limits_let_it_be(yaw_rad: float, limit: str) -> None:
    follower, at, theirs, shown = Follower(P), P.index("headYaw"), P.neutral(), []
    theirs[at] = yaw_rad
    for k in range(400):
        now_ns, out = 10**9 + k * STEP_NS, P.neutral()
        if k >= 50:
            follower.take(Header(FIRST, k, now_ns), theirs)
        follower.step(now_ns, DT, P.neutral(), out)
        shown.append(out[at])
    speed = np.diff(shown) / DT
    shares = {
        "speed": np.abs(speed).max() / P.max_speed[at],
        "acceleration": np.abs(np.diff(speed)).max() / DT / P.max_acceleration[at],
    }
    assert shown[-1] == yaw_rad
    assert shares[limit] == pytest.approx(0.6, abs=0.01) and max(shares.values()) < 0.61
