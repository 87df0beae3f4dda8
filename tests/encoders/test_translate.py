"""Translation with positions, and the characters a table cannot write."""

import shutil
import subprocess

import pytest
from hypothesis import given, settings, strategies as st

from encoders import GridShape, TextOptions, Undefined, UndefinedCharacter, back_translate, encode_text, translate
from encoders.braille.alphabet import alphabet
from encoders.braille.report import ReportLog
from encoders.braille.undefined import name_of, writable

UEB = ("en-ueb-g2.ctb",)
BACKSLASH_X = "⡳⠭"  # the library's own escape for what it cannot write


def write(text: str, table: str = "en-ueb-g2.ctb", policy: Undefined = Undefined.NAME, log: ReportLog | None = None):
    return writable(text, 0, alphabet((table,)), policy, log or ReportLog())


@pytest.mark.parametrize(
    ("text", "cells"),
    [
        ("Hello world 123", "⠠⠓⠑⠇⠇⠕⠀⠸⠺⠀⠼⠁⠃⠉"),
        ("knowledge", "⠅"),
        ("people", "⠏"),
        ("BBC", "⠠⠠⠃⠃⠉"),
        ("but, can; do", "⠃⠂⠀⠉⠆⠀⠙"),
        ("(child)", "⠐⠣⠡⠐⠜"),
        ("3.5", "⠼⠉⠲⠑"),
    ],
)
def test_unified_english_braille(text, cells):
    assert translate(UEB, text).cells == cells


@pytest.mark.skipif(shutil.which("lou_translate") is None, reason="liblouis-bin is not installed")
@pytest.mark.parametrize("table", ["en-ueb-g2.ctb", "de-g2.ctb", "fr-bfu-g2.ctb", "el.ctb", "ar-ar-g1.utb"])
def test_the_command_of_the_library_agrees(table):
    text = "Hello 27 (red) apples, mother; the end."
    done = subprocess.run(
        ["lou_translate", "--forward", f"unicode.dis,{table}"], input=text, capture_output=True, text=True, check=True
    )
    assert translate((table,), text).cells == done.stdout.strip("\n")


@given(st.text(st.sampled_from("abthe ,.A1é⠓-'"), min_size=1, max_size=80))
@settings(max_examples=200, deadline=None)
def test_positions_go_both_ways(text):
    done = translate(UEB, text)
    assert len(done.text_of_cell) == len(done.cells)
    assert len(done.cell_of_text) == len(text)
    assert list(done.text_of_cell) == sorted(done.text_of_cell)
    assert all(0 <= at < len(text) for at in done.text_of_cell)
    assert all(0 <= at <= len(done.cells) for at in done.cell_of_text)


def test_positions_of_a_known_text():
    done = translate(UEB, "Hello world")
    assert done.text_of_cell == (0, 0, 1, 2, 3, 4, 5, 6, 6)
    assert done.cell_of_text == (0, 2, 3, 4, 5, 6, 7, 7, 7, 7, 7)


@pytest.mark.parametrize("table", ["it-it-comp6.utb", "zh-hk.ctb", "en-ueb-g2.ctb"])
def test_braille_in_a_text_passes_through_whatever_the_table(table):
    assert translate((table,), "a⠓⠕b").cells[1:3] == "⠓⠕"


def test_back_translation_takes_unicode_braille_with_every_display_table():
    assert back_translate(UEB, "⠠⠓⠑⠇⠇⠕⠀⠸⠺⠀⠼⠁⠃⠉") == "Hello world 123"
    assert back_translate(("fr-bfu-g2.ctb",), translate(("fr-bfu-g2.ctb",), "bonjour").cells) == "bonjour"
    assert back_translate(("zh-hk.ctb",), "⠓⠝⠈").strip()


def test_long_texts_are_back_translated_in_pieces():
    text = "the river ran under the bridge " * 400
    assert back_translate(UEB, translate(UEB, text).cells).split() == text.split()


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("hi😂", "hi(face with tears of joy)"),
        ("👩🏽\u200d💻", "(woman, medium skin tone, personal computer)"),
        ("❤\ufe0f", "(heavy black heart)"),
        ("🇩🇪", "(flag de)"),
        ("漢", "(cjk unified ideograph-6f22)"),
        ("\x07\ue000", "(u+0007)(u+e000)"),
        ("e\u0301", "é"),
        ("ab\u00adc\u200bd\u2060", "abcd"),
        ("a\tb\u00a0c", "a b c"),
    ],
)
def test_characters_a_table_lacks_get_their_name(text, written):
    assert write(text).text == written


@pytest.mark.parametrize(
    "table",
    ["en-ueb-g2.ctb", "de-g2.ctb", "fr-bfu-g2.ctb", "zhcn-g2.ctb", "el.ctb", "ar-ar-g1.utb", "hi-in-g1.utb", "ru.ctb"],
)
def test_no_table_writes_escapes_or_blanks_in_silence(table):
    for char in "漢😂\x07Яहم":
        log = ReportLog()
        ready = write(char, table, log=log).text
        cells = translate((table,), ready).cells
        assert cells.strip("⠀")
        assert BACKSLASH_X not in cells
        assert (ready == char) == (log.undefined_total == 0)


def test_a_mark_the_table_lacks_is_named_behind_its_letter():
    assert write("x\u0304", "hi-in-g1.utb").text == "x(combining macron)"


def test_compatible_forms_are_written_and_reported():
    log = ReportLog()
    assert write("ﬁn", "fr-bfu-g2.ctb", log=log).text == "fin"
    (use,) = log.report.undefined
    assert (use.characters, use.action, use.written, use.first) == ("ﬁ", "respelled", "fi", 0)


@pytest.mark.parametrize(
    ("table", "typed"),
    [
        ("ar-ar-g1.utb", "السّ\u064eلامُ عَلَيْكُمْ يَا مُحَمّ\u064eد"),
        ("ar-ar-g1.utb", "م\u0651\u064e"),
        ("he-IL.utb", "ב\u05bc\u05b0רא\u05e9ית"),
        ("he-IL.utb", "\ufb2a\u05b8לו\u05b9ם"),
        ("el.ctb", "τι\u037e ναι\u0387 όχι"),
        ("pu-in-g1.utb", "\u0a36 \u0a33"),
        ("pa.tbl", "ਸਖਤ\u0a3c"),
        ("en-ueb-g2.ctb", "\u2329a\u232a \u212b"),
    ],
)
def test_what_is_typed_is_asked_of_the_table_first(table, typed):
    log = ReportLog()
    assert translate((table,), write(typed, table, log=log).text).cells == translate((table,), typed).cells
    assert log.undefined_total == 0


@pytest.mark.parametrize(
    ("table", "turned", "typed"),
    [
        ("ar-ar-g1.utb", "م\u064e\u0651", "م\u0651\u064e"),
        ("ar-ar-g1.utb", "م\u064b\u0651", "م\u0651\u064b"),
        ("he-IL.utb", "ב\u05b0\u05bc", "ב\u05bc\u05b0"),
        ("he-IL.utb", "ש\u05b8\u05bc\u05c1", "\ufb2c\u05b8"),
        ("he-IL.utb", "ש\u05c2\u05b8", "\ufb2b\u05b8"),
    ],
)
def test_vowels_come_last_as_they_are_typed_also_in_normalised_text(table, turned, typed):
    assert translate((table,), write(turned, table).text).cells == translate((table,), typed).cells
    assert encode_text(turned, GridShape(6, 6), TextOptions(table=table)).text_frames.check().cells_equal


@pytest.mark.parametrize(
    ("table", "given", "known"),
    [
        ("fr-bfu-g2.ctb", "e\u0301", "é"),
        ("pu-in-g1.utb", "\u0a38\u0a3c", "\u0a36"),
        ("el.ctb", ";·", "\u037e\u0387"),
        ("ar-ar-g1.utb", "\u0627\u0653", "\u0622"),
    ],
)
def test_canonically_equal_text_is_written_as_the_table_knows_it(table, given, known):
    log = ReportLog()
    assert translate((table,), write(given, table, log=log).text).cells == translate((table,), known).cells
    assert log.undefined_total == 0


def test_repeats_of_a_named_sign_are_counted():
    log = ReportLog()
    assert write("😂" * 50 + "a", log=log).text == "(face with tears of joy, 50 times)a"
    (use,) = log.report.undefined
    assert (use.count, use.action) == (50, "named")
    assert write("x\u0304x\u0304", "hi-in-g1.utb").text == "x(combining macron)" * 2


@pytest.mark.parametrize(
    ("table", "name"),
    [
        ("de-g2.ctb", "gesicht mit freudentränen"),
        ("fr-bfu-g2.ctb", "visage riant aux larmes"),
        ("ru-litbrl.ctb", "смеется до слез"),
        ("hi-in-g1.utb", "खुशी के आँसुओं वाला चेहरा"),
    ],
)
def test_signs_are_named_in_the_language_of_the_table(table, name):
    assert write("😂", table).text.strip("()").casefold() == name
    assert write("😂😂", table).text.strip("()").casefold() == f"{name} × 2"


def test_the_language_of_a_table_without_names_of_signs_falls_back_to_english():
    assert write("😂", "sah.utb").text.strip("()[]{} ") in {"face with tears of joy", "u+1f602", "128514"}


def test_colours_of_a_terminal_are_left_out():
    log = ReportLog()
    assert write("\x1b[1;31mred\x1b[0m \x1b]0;title\x07plain\x1bM", log=log).text == "red plain"
    assert (log.invisible, log.undefined_total) == (4, 0)
    assert write("\x1b[7mred").text == "red"


def test_a_sign_of_dot_8_alone_does_not_split_a_word_of_six_dots():
    typed, table = "می\u200cخواهم", "fa-ir-g1.utb"
    assert "⢀" in translate((table,), typed).cells
    (frame,) = encode_text(typed, GridShape(40, 96), TextOptions(table=table)).frames
    assert frame.cells.replace("\n", "").strip("⠀") == translate((table,), typed.replace("\u200c", "")).cells


def test_one_latin_letter_does_not_refuse_a_persian_text():
    scene = encode_text("گزینه B درست است", GridShape(6, 6), TextOptions(table="fa-ir-g1.utb"))
    assert scene.encoding["dots"] == 6
    assert scene.text_frames.check().cells_equal
    assert [use.action for use in scene.text_frames.report.undefined] == ["six dots"]


def test_a_hebrew_letter_with_its_dot_is_written_by_its_one_character():
    assert write("ש\u05b8\u05c1", "he-IL.utb").text == "\ufb2a\u05b8"


def test_names_fall_back_to_what_the_table_can_write(monkeypatch):
    letters = alphabet(("zhcn-g1.ctb",))
    lacking = type(letters)(letters.tables)
    digits = set("0123456789() ")
    monkeypatch.setattr(lacking, "writes", lambda char: char in digits)
    monkeypatch.setattr(lacking, "lacks", lambda chars: not digits.issuperset(chars))
    assert writable("😂", 0, lacking, Undefined.NAME, ReportLog()).text == "(128514)"
    digits.clear()
    log = ReportLog()
    assert writable("😂", 0, lacking, Undefined.NAME, log).text == ""
    assert log.report.undefined[0].action == "dropped"


def test_policies_drop_and_error():
    log = ReportLog()
    assert write("a😂b😂", policy=Undefined.DROP, log=log).text == "ab"
    assert [(use.action, use.first, use.count) for use in log.report.undefined] == [("dropped", 1, 2)]
    with pytest.raises(UndefinedCharacter, match=r"character 1: .* cannot write face with tears of joy \(U\+1F602\)"):
        write("a😂b", policy=Undefined.ERROR)


@given(st.text(max_size=60))
@settings(max_examples=150, deadline=None)
def test_any_text_becomes_writable_with_origins_inside_it(text):
    ready = write(text)
    origins = list(range(len(text))) if ready.origins is None else ready.origins
    assert len(origins) == len(ready.text)
    assert origins == sorted(origins)
    assert all(0 <= at < len(text) for at in origins)
    assert not alphabet(UEB).lacks(ready.text)


def test_the_report_is_bounded():
    log = ReportLog()
    write("".join(chr(0x4E00 + at) for at in range(500)), log=log)
    assert len(log.report.undefined) == 100
    assert log.report.undefined_total == 500


def test_names():
    assert name_of("\U0001f44b\U0001f3ff") == "waving hand sign, dark skin tone"
