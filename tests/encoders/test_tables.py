"""Finding liblouis, its tables, and saying what is missing."""

import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

from encoders import LouisMissing, TableMissing, list_tables, recommended_tables, resolve_tables
from encoders.braille import louis_binding, louis_cure
from encoders.braille.tables import foreign_tables, hyphenation_tables, table_dots

ROOT = Path(__file__).resolve().parents[2]


def test_tables_carry_metadata():
    tables = {info.file: info for info in list_tables()}
    assert len(tables) > 100
    ueb = tables["en-ueb-g2.ctb"]
    assert (ueb.language, ueb.grade, ueb.contraction) == ("en", "2", "full")
    assert "English" in ueb.name
    assert tables["de-g2.ctb"].direction == "forward"


@pytest.mark.parametrize(
    ("spec", "tables"),
    [
        ("en-ueb-g1.ctb", ("en-ueb-g1.ctb",)),
        (" en-ueb-g2.ctb , hyph_en_US.dic ", ("en-ueb-g2.ctb", "hyph_en_US.dic")),
        ("language:de grade:2", ("de-g2.ctb",)),
        ("language:pl", ("pl.tbl",)),
        ("language:hi", ("hi.tbl",)),
        ("language:en", ("en-ueb-g1.ctb",)),
        ("language:en-GB grade:contracted", ("en-ueb-g2.ctb",)),
        ("language:de", ("de-g0.utb",)),
        ("language:de grade:contracted", ("de-g2.ctb",)),
        ("language:ru grade:uncontracted", ("ru-litbrl.ctb",)),
        ("language:fr grade:1", ("fr-bfu-comp6.utb",)),
        ("language:pl grade:1", ("pl.tbl",)),
        ("language:fa", ("fa-ir-g1.utb",)),
        ("language:zh", ("zhcn-cbs.ctb",)),
        ("language:zh-Hant-TW", ("zh-tw.ctb",)),
        ("language:zh-HK", ("zh_HK.tbl",)),
        ("language:nb grade:contracted", ("no-no-g3.ctb",)),
        ("language:da grade:contracted", ("da-dk-g26.ctb",)),
        ("language:da grade:2 dots:8", ("da-dk-g28.ctb",)),
    ],
)
def test_specs(spec, tables):
    assert resolve_tables(spec) == tables


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("en-ueb-g3.ctb", "'en-ueb-g3.ctb': no such table; nearest: en-ueb-g2.ctb"),
        ("EN-UEB-G22.CTB", "nearest: en-ueb-g2.ctb"),
        ("norwegian", "nearest: no-no"),
        ("en-ueb-g2.ctb,none.dic", "'none.dic'"),
        ("language:de grade:9", "for language de there are: de-"),
        ("language:xx", "none answers the query"),
        ("language:th", "no table for language 'th'; 'dotwave tables' lists those it has, a newer liblouis"),
        ("language:german", r"did you mean de \(German\)"),
        ("language:ms grade:uncontracted", r"for language ms there are: ms-my-g2.ctb \(Malay braille\)"),
        ("", "empty"),
        (",", "no such table|does not compile"),
        ("x" * 5000, "5000 characters; a name or list of names has at most 1000"),
        ("en-ueb-g2.ctb\0.dic", "a character that no table's name has"),
        ("\ud800.ctb", "a character that no table's name has"),
        ("gr\xfc\xdfe.ctb", "'gr\xfc\xdfe.ctb': no such table"),
        ("gr\udcfc.ctb", "a character that no table's name has"),
    ],
)
def test_a_wrong_table_is_one_line_with_the_nearest(spec, says):
    with pytest.raises(TableMissing, match=says) as caught:
        resolve_tables(spec)
    assert "\n" not in str(caught.value)


def test_a_table_that_does_not_compile_says_why(tmp_path, capfd):
    path = tmp_path / "broken.utb"
    path.write_text("nonsense a b\n")
    with pytest.raises(TableMissing, match=r"does not compile: .*broken\.utb:1: expected a rule of liblouis") as caught:
        resolve_tables(str(path))
    assert "nonsense" not in str(caught.value), "what stands in a file is told to nobody"
    assert capfd.readouterr() == ("", ""), "the library itself prints nothing"


def test_every_language_of_literary_braille_has_a_recommended_table():
    found = recommended_tables()
    assert (found["en-ueb-g2.ctb"], found["de-g0.utb"]) == ("contracted", "uncontracted")
    of = {info.language.split("-")[0]: False for info in list_tables() if info.kind == "literary" and info.dots != 8}
    of |= {info.language.split("-")[0]: True for info in list_tables() if info.file in found}
    assert all(of.values()), of
    assert not [info.file for info in list_tables() if info.file in found and info.kind == "computer"]


def test_tables_that_liblouis_did_not_bring_along(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert foreign_tables("en-ueb-g2.ctb, hyph_en_US.dic") == foreign_tables("language:de grade:2") == ()
    assert foreign_tables("en-ueb-g2.ctb,./own.utb,../x") == ("./own.utb", "../x")
    assert foreign_tables("/etc/passwd") == ("/etc/passwd",)
    (tmp_path / "en-ueb-g2.ctb").touch()
    assert foreign_tables("en-ueb-g2.ctb") == ("en-ueb-g2.ctb",), "liblouis would take the file of the current folder"


def test_dots_of_tables():
    assert table_dots(("el.ctb",)) == 6
    assert table_dots(("pl-pl-comp8.ctb",)) == 8
    assert table_dots(("es-g1.ctb",)) == 0


def test_hyphenation_dictionaries_are_found_by_language():
    table, dictionary = hyphenation_tables(("de-g2.ctb",))
    assert (table, Path(dictionary).name) == ("de-g2.ctb", "hyph_de_DE.dic")
    assert Path(dictionary).is_file(), "a file of that name in the current folder is not meant"
    assert hyphenation_tables(("ar-ar-g1.utb",)) == ()
    assert louis_binding.hyphenate(("en-ueb-g2.ctb", "hyph_en_US.dic"), "knowledgeable") == [5, 9]


def test_a_noisy_table_prints_nothing(capfd):
    louis_binding.translate(("ko-g2.ctb",), "한국어")
    assert capfd.readouterr() == ("", "")


def test_a_false_louis_is_passed_over(monkeypatch):
    monkeypatch.setitem(sys.modules, "louis", types.ModuleType("louis"))
    assert louis_binding._imported() is None


def test_without_liblouis_the_cure_is_named(monkeypatch):
    monkeypatch.setattr(louis_binding, "_imported", lambda: None)
    monkeypatch.setattr(louis_binding, "_from_distribution", lambda: None)
    with pytest.raises(LouisMissing, match=re.escape(louis_cure.install_words())):
        louis_binding._louis.__wrapped__()


@pytest.mark.parametrize("tool", louis_cure.INSTALLERS)
def test_the_cure_is_that_of_the_package_manager(monkeypatch, tool):
    monkeypatch.setattr(shutil, "which", lambda name: f"/bin/{name}" if name == tool else None)
    assert louis_cure.install_words() == f"install it with: {louis_cure.INSTALLERS[tool]}"


@pytest.mark.parametrize(("platform", "says"), [("darwin", "Homebrew"), ("win32", "wsl"), ("linux", "liblouis.io")])
def test_without_a_package_manager_the_cure_is_that_of_the_system(monkeypatch, platform, says):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(sys, "platform", platform)
    assert says in louis_cure.install_words()
    assert ("apt-get" in louis_cure.install_words()) == (platform == "win32")


def test_run_names_the_same_cures():
    lines = [line.strip() for line in (ROOT / "run").read_text(encoding="utf-8").splitlines()]
    for tool, command in louis_cure.INSTALLERS.items():
        if tool == "apt-get":
            assert 'apt_install "$@"' in lines
            assert 'has_louis || set -- "$@" python3-louis' in lines
        else:
            asked = next(number for number, line in enumerate(lines) if f"if command -v {tool} >" in line)
            assert lines[asked + 1] == f"echo '{command}'"
    for words in (louis_cure.ELSEWHERE["darwin"], louis_cure.UNKNOWN):
        assert f"echo '{words}'" in lines


def test_importing_encoders_is_light():
    code = (
        "import sys, encoders; print(sorted(m for m in "
        "('louis', 'numba', 'scipy', 'matplotlib', 'PIL', 'dask', 'pydantic') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
