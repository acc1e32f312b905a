"""TextGrid of Praat and MFA, and the JSON of aeneas."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes import aligned
from controller.takes.aligned import Interval, sounds_of
from controller.takes.reader import load_take
from controller.vocabulary.visemes import Visemes

JAW, ROLL, PUCKER = P.index("jawOpen"), P.index("mouthRollLower"), P.index("mouthPucker")
LONG = '''File type = "ooTextFile"
Object class = "TextGrid"

xmin = 0
xmax = 1
tiers? <exists>
size = 2
item []:
    item [1]:
        class = "IntervalTier"
        name = "words"
        xmin = 0
        xmax = 1
        intervals: size = 1
        intervals [1]:
            xmin = 0
            xmax = 1
            text = "say ""mama"""
    item [2]:
        class = "IntervalTier"
        name = "phones"
        xmin = 0
        xmax = 1
        intervals: size = 4
        intervals [1]:
            xmin = 0
            xmax = 0.2
            text = ""
        intervals [2]:
            xmin = 0.2
            xmax = 0.35
            text = "M"
        intervals [3]:
            xmin = 0.35
            xmax = 0.7
            text = "AA1"
        intervals [4]:
            xmin = 0.7
            xmax = 1
            text = "sp"
'''
SHORT = '''File type = "ooTextFile"
Object class = "TextGrid"

0
1
<exists>
2
"IntervalTier"
"words"
0
1
1
0
1
"say ""mama"""
"IntervalTier"
"phones"
0
1
4
0
0.2
""
0.2
0.35
"M"
0.35
0.7
"AA1"
0.7
1
"sp"
'''


def tier(*intervals: tuple[float, float, str], name: str = "phones", kind: str = "IntervalTier") -> str:
    rows = "".join(f'{a} {b} "{text}"\n' for a, b, text in intervals)
    return f'"ooTextFile"\n"TextGrid"\n0\n9\n<exists>\n1\n"{kind}"\n"{name}"\n0\n9\n{len(intervals)}\n{rows}'


def read(path: Path, text: str, encoding: str = "utf-8") -> np.ndarray:
    path.write_bytes(text.encode(encoding))
    return load_take(path, P).values


@pytest.mark.parametrize("text", [LONG, SHORT, LONG.replace("\n", "\r\n")], ids=["long", "short", "crlf"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_form_and_encoding_of_textgrid_is_the_same(tmp_path: Path, text: str, encoding: str) -> None:
    values = read(tmp_path / "a.TextGrid", text, encoding)
    assert values[27, ROLL] > 0.3 > 0.1 > values[27, JAW] and values[50, JAW] > 0.5 and values[95, JAW] < 0.05
    np.testing.assert_array_equal(values, read(tmp_path / "b.TextGrid", SHORT))


def test_the_sounds_of_a_tier_with_their_times(tmp_path: Path) -> None:
    (tmp_path / "a.TextGrid").write_text(LONG)
    found = sounds_of(tmp_path / "a.TextGrid", Visemes.load(P))
    assert [(start, end, text) for start, end, text, _ in found] == [(0.2, 0.35, "M"), (0.35, 0.7, "AA1")]
    (tmp_path / "b.TextGrid").write_text(tier((0.0, 1.0, "mama"), name="words"))
    with pytest.raises(TakeError, match="no tier of sounds"):
        sounds_of(tmp_path / "b.TextGrid", Visemes.load(P))


def test_damaged_utf_16_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "a.TextGrid").write_bytes(b"\xff\xfe" + LONG.encode("utf-16-le")[:99])
    with pytest.raises(TakeError, match="its UTF-16 is damaged at byte"):
        load_take(tmp_path / "a.TextGrid", P)


def test_big_endian_utf_16(tmp_path: Path) -> None:
    assert read(tmp_path / "a.TextGrid", "\ufeff" + LONG, "utf-16-be")[50, JAW] > 0.5


def test_symbols_of_the_ipa_and_labels_of_silence(tmp_path: Path) -> None:
    text = tier((0.0, 0.2, "spn"), (0.2, 0.5, "uː"), (0.5, 0.6, ""), (0.8, 1.1, "ɑ"), name="Speaker 1 - phones")
    values = read(tmp_path / "a.TextGrid", text)
    assert values[35, PUCKER] > 0.6 and values[70, JAW] < 0.1 and values[95, JAW] > 0.4


def test_a_tier_of_words_alone_is_spelt(tmp_path: Path) -> None:
    values = read(tmp_path / "a.TextGrid", tier((0.0, 0.3, ""), (0.3, 0.9, "mama"), name="words"))
    jaw = values[:, JAW]
    assert jaw[:25].max() < 0.1 and jaw[35] < 0.2 < 0.35 < jaw[50] and jaw[65] < 0.25 < 0.4 < jaw[82]


def test_a_tier_of_any_name_that_holds_sounds_is_one_of_sounds(tmp_path: Path) -> None:
    values = read(tmp_path / "a.TextGrid", tier((0.0, 0.3, "P"), (0.3, 0.9, "OW1"), name="Mary"))
    assert values[60, PUCKER] > 0.6 and values[10, ROLL] > 0.3


def test_sounds_that_are_not_in_order_keep_their_times(tmp_path: Path) -> None:
    later, earlier = (0.5, 1.0, "AA1"), (0.0, 0.5, "M")
    values = read(tmp_path / "a.TextGrid", tier(later, earlier))
    np.testing.assert_array_equal(values, read(tmp_path / "b.TextGrid", tier(earlier, later)))
    assert values[20, ROLL] > 0.3 and values[70, JAW] > 0.5


def test_a_gap_between_sounds_is_silent_and_one_by_rounding_is_none(tmp_path: Path) -> None:
    whole = read(tmp_path / "a.TextGrid", tier((0.0, 0.5, "AA1"), (0.5, 1.0, "AA1")))
    rounded = read(tmp_path / "b.TextGrid", tier((0.0, 0.4995, "AA1"), (0.5, 1.0, "AA1")))
    np.testing.assert_allclose(whole[:, JAW], rounded[:, JAW], atol=1e-3)
    gap = read(tmp_path / "c.TextGrid", tier((0.3, 0.5, "AA1"), (0.8, 1.0, "AA1")))
    assert gap[65, JAW] < 0.05 and gap[5, JAW] < 0.05 < 0.4 < gap[45, JAW]


@pytest.mark.parametrize(("begin_s", "gaps"), [(0.4, 0), (0.5, 0), (0.5009, 0), (0.5011, 1), (0.8, 1), (1.2, 1)])
@pytest.mark.parametrize(
    ("make", "label"), [(aligned._cues_of_sounds, "AA1"), (aligned._cues_of_words, "a")], ids=["sounds", "words"]
)
def test_a_gap_of_more_than_a_thousandth_of_a_second_is_a_pause(
    make: Any, label: str, begin_s: float, gaps: int
) -> None:
    tier = [Interval(0.0, 0.5, label), Interval(begin_s, 1.5, label)]
    visemes = Visemes.load(P)
    cues, end_s = make(tier, visemes)
    assert [cue.start_s for cue in cues] == pytest.approx([0.0] + [0.5] * gaps + [begin_s]) and end_s == 1.5
    silence = visemes.weights(visemes.names[0])
    assert [bool((cue.weights == silence).all()) for cue in cues] == [False] + [True] * gaps + [False]
    assert make(tier[::-1], visemes)[1] == 1.5  # in whatever order they are written
    late, _ = make([Interval(0.0011, 0.5, label)], visemes)
    soon, _ = make([Interval(0.0009, 0.5, label)], visemes)
    assert (len(late), len(soon)) == (2, 1)


def test_times_that_rounding_made_a_little_less_than_nothing_are_nothing(tmp_path: Path) -> None:
    values = read(tmp_path / "a.TextGrid", tier((-1e-9, 0.5, "AA1")))
    np.testing.assert_array_equal(values, read(tmp_path / "b.TextGrid", tier((0.0, 0.5, "AA1"))))
    with pytest.raises(TakeError, match="its times are"):
        read(tmp_path / "c.TextGrid", tier((-1e-3, 0.5, "AA1")))
    with pytest.raises(TakeError, match="its times are"):
        read(tmp_path / "d.TextGrid", tier((0.5, 0.4, "AA1")))


def test_of_several_tiers_of_sounds_the_longest_counts(tmp_path: Path) -> None:
    two = SHORT.replace('"words"', '"phone"').replace('"say ""mama"""', '"OW1"')
    values = read(tmp_path / "a.TextGrid", two)
    np.testing.assert_array_equal(values, read(tmp_path / "b.TextGrid", SHORT))


def test_letters_of_a_word_last_as_long_as_their_sounds_usually_do(tmp_path: Path) -> None:
    """Spelt over twice the time, every sound begins twice as late."""
    one, two = (read(tmp_path / f"{k}.TextGrid", tier((0.0, k, "mama"), name="words"))[:, JAW] for k in (1.0, 2.0))
    opening = [np.flatnonzero(np.diff((jaw > 0.3).astype(int)) == 1) for jaw in (one, two)]
    assert len(opening[0]) == len(opening[1]) == 2
    visemes = Visemes.load(P)
    lengths = visemes.spell("mama") @ visemes.duration
    starts = (np.cumsum(lengths) - lengths) / lengths.sum()
    assert opening[1] == pytest.approx(200.0 * starts[[1, 3]], abs=12.0)


def test_points_last_until_the_next(tmp_path: Path) -> None:
    points = '"ooTextFile"\n"TextGrid"\n0\n1\n<exists>\n1\n"TextTier"\n"phones"\n0\n1\n2\n0.2 "aa"\n0.6 "PP"\n'
    values = read(tmp_path / "a.TextGrid", points)
    assert values[40, JAW] > 0.4 and values[80, JAW] < 0.05 < values[80, ROLL]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "it ends too early"),
        ("hello", "it ends too early"),
        (LONG[: LONG.index('"AA1"')], "it ends too early"),
        (LONG.replace("TextGrid", "Sound"), "begins without"),
        (LONG.replace("<exists>", "<absent>"), "it has no tiers"),
        (LONG.replace("size = 2", "size = 2.5"), "2.5 is not a count"),
        (LONG.replace("size = 2", "size = -1"), "-1 is not a count"),
        (LONG.replace("size = 2", "size = 10000000"), r"1e\+07 is not a count"),
        (LONG.replace("size = 2", "size = 9999999"), "it ends too early"),
        (LONG.replace("size = 2", "size = 3"), "it ends too early"),
        (LONG.replace('"IntervalTier"', '"PitchTier"'), "tier 1 is a 'PitchTier'"),
        (LONG.replace("xmax = 0.35", "xmax = 0.1"), "its times are 0.2 to 0.1 s"),
        (LONG.replace("xmax = 0.35", 'xmax = "x"'), "instead of a number"),
        (LONG.replace('"M"', "5"), "'5' instead of a string"),
        (LONG.replace('"M"', '"✂"'), "unknown viseme or phoneme '✂'"),
        (tier((0.0, 1.0, ""), (1.0, 2.0, "sil")), "no tier has any text"),
        (tier((0.0, 1e300, "AA")), "3600 s are read"),
        ("ooBinaryFile\x08TextGrid", "it is a binary file"),
    ],
)
def test_what_is_wrong_with_a_textgrid_is_named(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(TakeError, match=why) as caught:
        read(tmp_path / "a.TextGrid", text)
    assert caught.value.hint and "a.TextGrid" in str(caught.value)


def fragments(*found: tuple[str, str, str]) -> str:
    return json.dumps({"fragments": [
        {"begin": a, "end": b, "id": f"f{i}", "language": "eng", "lines": [text], "children": []}
        for i, (a, b, text) in enumerate(found)
    ]})  # fmt: skip


def test_fragments_of_aeneas_are_spelt_over_their_time(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(fragments(("0.000", "0.400", ""), ("0.400", "1.400", "Papa"), ("1.400", "2.000", "who")))
    values = load_take(path, P).values
    assert values[:30, JAW].max() < 0.1 and values[70:90, JAW].max() > 0.4 and values[150:190, PUCKER].max() > 0.6
    assert 2.0 < len(values) / 100 < 2.2


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"fragments": 5}', "no list fragments"),
        ('{"fragments": [5]}', r"fragments\[0\] must be an object"),
        ('{"fragments": [{"begin": "x", "end": "1", "lines": []}]}', r"fragments\[0\].begin must be a time"),
        ('{"fragments": [{"begin": "0", "lines": []}]}', r"fragments\[0\].end must be a time"),
        ('{"fragments": [{"begin": "2", "end": "1", "lines": []}]}', "its times are 2 to 1 s"),
        ('{"fragments": [{"begin": "nan", "end": "1", "lines": []}]}', "its times are nan"),
        ('{"fragments": [{"begin": "0", "end": "1", "lines": [1]}]}', "lines must be a list of texts"),
        ('{"fragments": []}', "at least one sound"),
        ('{"fragments": [', "not valid JSON"),
    ],
)
def test_what_is_wrong_with_aeneas_is_named(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(TakeError, match=why) as caught:
        load_take(tmp_path / "a.json", P)
    assert caught.value.hint
