"""Each page read alone says its part of the text: numbers, capitals and addresses keep their indicators."""

import itertools
from functools import cache
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings, strategies as st

from encoders import (
    FeltPage,
    GoesOn,
    GridShape,
    TextOptions,
    back_check,
    back_translate,
    encode_text,
    join_pages,
    translate,
)
from encoders.braille.joining import unmarked

GRID, WIDE = GridShape(6, 6), GridShape(40, 96)
SAMPLES = Path(__file__).parents[2] / "samples" / "texts"
TABLES = {
    "en": "en-ueb-g2.ctb", "de": "de-g2.ctb", "fr": "fr-bfu-g2.ctb", "ru": "ru-litbrl.ctb", "ar": "ar-ar-g1.utb",
    "hi": "hi-in-g1.utb", "zh": "zhcn-g2.ctb", "ko": "ko-g2.ctb", "el": "el.ctb", "he": "he-IL.utb",
}  # fmt: skip
NUMBER_SIGN = {name: "⠠" if name == "fr" else "⠼" for name in TABLES}


def pages_of(text: str, table: str = "en-ueb-g2.ctb", shape: GridShape = GRID):
    return list(encode_text(text, shape, TextOptions(table=table)).frames)


def alone(frame, encoding) -> str:
    return unmarked(frame.cells, encoding, frame.goes_on)


@pytest.mark.parametrize(
    ("text", "pages"),
    [
        ("5550199", [("5550", "⠼⠑⠑⠑⠚⠐"), ("199", "⠼⠁⠊⠊")]),
        ("12.11.1987,", [("12.", "⠼⠁⠃⠲⠐"), ("11.", "⠼⠁⠁⠲⠐"), ("1987,", "⠼⠁⠊⠓⠛⠂")]),
        ("12,345", [("12,", "⠼⠁⠃⠂⠐"), ("345", "⠼⠉⠙⠑")]),
        ("12 345", [("12 ", "⠼⠁⠃⠐"), ("345", "⠼⠉⠙⠑")]),
        ("UNESCO", [("UN", "⠠⠠⠥⠝⠤"), ("ESCO", "⠠⠠⠑⠎⠉⠕")]),
        ("A-12/7", [("A-", "⠠⠁⠤"), ("12/", "⠼⠁⠃⠸⠌⠐"), ("7", "⠼⠛")]),
    ],
)
def test_what_is_cut_has_its_indicators_on_each_page(text, pages):
    frames = pages_of(text)
    assert [(frame.text, frame.cells.replace("\n", "").rstrip("⠀")) for frame in frames] == pages
    encoding = encode_text(text, GRID, TextOptions()).encoding
    read = [back_translate(("en-ueb-g2.ctb",), alone(frame, encoding)) for frame in frames]
    assert read == [part.strip() for part, _ in pages]


def test_no_hyphen_is_added_to_an_address():
    for table in ("en-ueb-g2.ctb", "de-g2.ctb", "fr-bfu-g2.ctb", "ru-litbrl.ctb"):
        frames = pages_of("exam.example.org/serial", table)
        assert len(frames) > 2
        assert not any("⠤" in frame.cells for frame in frames), table


@pytest.mark.parametrize("language", sorted(TABLES))
@pytest.mark.parametrize("text", ["5550199", "12.11.1987,", "12,345", "UNESCO", "(NATO-)", "x5550199y"])
def test_no_indicator_stands_alone_and_the_pages_join_exactly(language, text):
    table = TABLES[language]
    scene = encode_text(text, GRID, TextOptions(table=table))
    frames = list(scene.frames)
    joined = join_pages([frame.cells for frame in frames], scene.encoding, [frame.goes_on for frame in frames])
    assert joined == translate((table,), text).cells.strip("⠀")
    for frame in frames:
        cells = alone(frame, scene.encoding)
        assert cells == translate((table,), frame.text).cells.strip("⠀"), frame.text
        assert not cells.endswith(NUMBER_SIGN[language])
    assert "".join(frame.text for frame in frames) == text


def test_the_code_says_what_a_cut_number_ends_with():
    signs = {language: pages_of("5550199", table)[0].goes_on[0].mark for language, table in TABLES.items()}
    assert signs == {name: {"en": "⠐", "de": "⠈"}.get(name, "") for name in TABLES}


def test_capitals_of_several_words_are_marked_on_each_small_page_and_once_on_a_large_one():
    text = "THE OLD CLOCK"
    assert [frame.cells[:2] for frame in pages_of(text)] == ["⠠⠠"] * 4
    (large,) = pages_of(text, shape=WIDE)
    assert large.cells.startswith("⠀⠀⠠⠠⠠⠮⠀⠕⠇⠙⠀")
    assert encode_text(text, GRID, TextOptions()).text_frames.check().ok


def test_latin_words_side_by_side_each_say_so():
    check = encode_text(
        "Это Debian Free Software для всех", GRID, TextOptions(table="ru-litbrl.ctb")
    ).text_frames.check()
    assert check.cells_equal
    assert check.alone == ()


def test_a_page_that_lost_its_number_sign_is_found_and_named():
    scene = encode_text("call 5550199 now", GRID, TextOptions())
    pages = [FeltPage(frame.cells, frame.text, frame.goes_on) for frame in scene.frames]
    assert back_check(pages, "call 5550199 now", scene.encoding).alone == ()
    # The first part ends with the hyphen and the rest has no sign, as it would be without care.
    bare = [page._replace(cells=page.cells.replace("⠼⠁⠊\n⠊", "⠁⠊⠊\n⠀")) for page in pages]
    bare = [page._replace(goes_on=tuple(GoesOn(one.run, one.mark) for one in page.goes_on)) for page in bare]
    check = back_check(bare, "call 5550199 now", scene.encoding)
    assert check.cells_equal, "together they are the cells of the text"
    assert check.sentence.endswith("Pages that read alone say something else: 1.")
    (wrong,) = check.alone
    assert wrong.sentence == "page 3: '199' read alone is 'aii'"


def test_a_german_address_is_read_by_what_follows_on_the_next_pages():
    text = "die Datei /etc/mdadm/mdadm.conf, die Option --create und --fail"
    scene = encode_text(text, GRID, TextOptions(table="de-g2.ctb"))
    check = scene.text_frames.check()
    assert check.cells_equal
    assert check.alone == ()
    frames = list(scene.frames)
    place = next(number for number, frame in enumerate(frames) if frame.text == "c/")
    pages = [FeltPage(frame.cells, frame.text, frame.goes_on) for frame in frames]
    # Without its indicator the same part is a word, whatever follows.
    assert pages[place].cells.startswith("⠠⠨⠉")
    pages[place] = pages[place]._replace(cells="⠉⠲⠈\n⠀⠀⠀")
    assert [one.page for one in back_check(pages, text, scene.encoding).alone] == [place]


def test_manifests_of_old_are_joined_by_their_dots():
    encoding = {"run": 6, "hyphen": "⠤"}
    assert join_pages(["⠼⠑⠑⠑⠚⠤", "⠁⠊⠊⠀⠀⠀", "⠝⠪⠀⠀⠀⠀"], encoding) == "⠼⠑⠑⠑⠚⠁⠊⠊⠀⠝⠪"


def test_a_contraction_over_a_syllable_is_dissolved():
    frames = pages_of("handkerchiefs disease")
    joined = "".join(itertools.chain.from_iterable(frame.text for frame in frames))
    assert joined == "handkerchiefsdisease"
    check = encode_text("handkerchiefs disease", GRID, TextOptions()).text_frames.check()
    assert check.text_equal
    assert check.alone == ()


WORDS = {
    "en": ["knowledgeable", "the", "Anna", "McDonald", "well-known", "NASA", "creation", "don't"],
    "de": ["Donaudampfschiff", "und", "ADAC", "Überblick", "Straße", "E-Mail", "Zusammenhang"],
    "fr": ["l'anniversaire", "SNCF", "été", "aujourd'hui", "Parallèlement", "porte-monnaie"],
    "ru": ["здравствуйте", "США", "Москва", "и", "по-русски", "Debian"],
    "ar": ["الاستخدامات", "مُحَمَّد", "في", "والمعلومات"],
    "hi": ["विश्वविद्यालय", "और", "हिन्दी", "स्वतंत्रता"],
    "zh": ["中国人民银行", "的", "计算机", "网络连接"],
    "ko": ["대한민국헌법", "그리고", "컴퓨터를", "네트워크"],
    "el": ["οικογένειας", "και", "Αθήνα", "ΟΗΕ", "είναι"],
    "he": ["אוניברסיטה", "של", "ירושלים", "שָׁלוֹם"],
}
FIGURES = ["5550199", "12.11.1987,", "3,141,592", "(2026)", "007-12345/9", "1987", "UNESCO", "A4", "100%"]


@cache
def bits(language: str):
    return st.lists(
        st.one_of(
            st.sampled_from(WORDS[language]), st.sampled_from(FIGURES), st.integers(0, 10**9).map(str),
        ), min_size=1, max_size=6,
    )  # fmt: skip


@pytest.mark.parametrize("language", sorted(TABLES))
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_any_words_and_numbers_are_read_page_by_page(language, data):
    text = " ".join(data.draw(bits(language)))
    scene = encode_text(text, GRID, TextOptions(table=TABLES[language]))
    check = scene.text_frames.check()
    assert check.cells_equal
    assert [one.sentence for one in check.alone] == []
    assert all(frame.cells.strip("⠀\n") for frame in scene.frames)


PROSE = {
    "he": "השען לימד את בתו לקרוא את השעה בידיים. בשנת 1987 היא בנתה שעון ללא פעמון, ומספרו 5550199. שָׁלוֹם לכולם!",
    "ko": "시계공은 딸에게 손으로 시간을 읽는 법을 가르쳤다. 1987년에 그녀는 종이 없는 시계를 만들었다. 5550199이다.",
}


@pytest.mark.parametrize("language", sorted(TABLES))
@pytest.mark.parametrize("shape", [GRID, WIDE], ids=["6x6", "40x96"])
def test_prose_is_read_page_by_page(language, shape):
    text = PROSE.get(language) or (SAMPLES / f"{language}.txt").read_text()
    check = encode_text(f"{text} 12.11.1987, 12,345.", shape, TextOptions(table=TABLES[language])).text_frames.check()
    assert check.cells_equal
    assert [one.sentence for one in check.alone] == []


def test_every_sample_is_read_page_by_page():
    for name, about in yaml.safe_load((SAMPLES / "languages.yaml").read_text()).items():
        check = encode_text((SAMPLES / name).read_text(), GRID, TextOptions(table=about["table"])).text_frames.check()
        assert [one.sentence for one in check.alone] == [], name
