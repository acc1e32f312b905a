"""Every format: what it can carry comes back, rubbish does no harm, and a package's own format is checked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS, TRANSPORTS
from controller.formats.frame import Frame, Splitter
from tests.controller.formats.faces import KINDS, face, there_and_back, tolerance


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_format_can_carry_comes_back(kind: str) -> None:
    form = FORMATS.get(kind)
    sent = [face(seed, 0.5 + seed / 60) for seed in range(5)]
    found = there_and_back(form, sent)
    assert len(found) == 5
    carried = form.carries(P)
    known = carried | form.about(P)
    assert known.any() and not (carried & form.about(P)).any()
    for before, after in zip(sent, found, strict=True):
        assert after.face and after.mask[known].all() and not after.mask[~known].any()
        np.testing.assert_allclose(after.values[carried], before.values[carried], atol=tolerance(form))
    assert np.isfinite([frame.values for frame in found]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_frames_of_a_decoder_do_not_change_afterwards(kind: str) -> None:
    form = FORMATS.get(kind)
    first, second = there_and_back(form, [face(1), Frame(P.neutral(), face(1).mask)])
    assert not np.shares_memory(first.values, second.values)
    assert abs(first.values - second.values).max() > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_the_next_good_message_after_any_rubbish_is_taken(kind: str) -> None:
    form = FORMATS.get(kind)
    decoder, encoder, rng = form.decoder(P), form.encoder(P), np.random.default_rng(3)
    carried = form.carries(P)
    for seed in range(20):
        for message in encoder.encode(face(100 + seed)):
            decoder.feed(rng.bytes(len(message)))
            damaged = bytearray(message)
            damaged[int(rng.integers(len(damaged)))] ^= 1 << int(rng.integers(8))
            decoder.feed(bytes(damaged))
        sent = face(seed)
        found = [frame for message in encoder.encode(sent) for frame in decoder.feed(message)]
        np.testing.assert_allclose(found[-1].values[carried], sent.values[carried], atol=tolerance(form))
    assert sum(decoder.refused.values()) > 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_stream_is_cut_into_messages_wherever_its_pieces_end(kind: str) -> None:
    form = FORMATS.get(kind)
    if not form.delimiter:
        pytest.skip("datagrams only")
    encoder, decoder = form.encoder(P), form.decoder(P)
    splitter = Splitter(form.delimiter, form.most, decoder.refused)
    sent = [face(seed) for seed in range(4)]
    stream = b"rubbish" + form.delimiter
    stream += b"".join(message + form.delimiter for frame in sent for message in encoder.encode(frame))
    found = [
        frame
        for at in range(0, len(stream), 7)
        for message in splitter.feed(stream[at : at + 7])
        for frame in decoder.feed(message)
    ]
    assert len(found) == 4
    carried = form.carries(P)
    np.testing.assert_allclose(found[-1].values[carried], sent[-1].values[carried], atol=tolerance(form))


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_without_a_face_can_be_sent(kind: str) -> None:
    form = FORMATS.get(kind)
    nobody = Frame(P.neutral(), np.zeros(len(P), dtype=bool), 1.0, face=False)
    assert not any(found.face and found.mask.any() for found in there_and_back(form, [nobody]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_definition_says_how_its_messages_travel(kind: str) -> None:
    form = FORMATS.get(kind)
    assert set(form.transports) <= set(TRANSPORTS) and form.title
    assert max(map(len, form.encoder(P).encode(face(0)))) <= form.most


def test_a_format_of_a_package_must_say_how_it_travels() -> None:
    form = FORMATS.get("livelink")
    with pytest.raises(ValueError, match="transports must be of"):
        FORMATS.check(replace(form, transports=("pigeon",)))
    with pytest.raises(ValueError, match="needs a delimiter"):
        FORMATS.check(replace(form, transports=("tcp",)))
