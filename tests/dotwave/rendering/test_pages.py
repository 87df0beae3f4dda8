"""Where words go on, from the text through the files to what is read from the felt dots."""

import json

from chainsim import load_device
from dotwave.rendering.render import render
from dotwave.verification import verify
from drivers import read_waveform
from encoders import GoesOn, GridShape, TextOptions, encode_text


def rendered(folder, text="call 5550199 now"):
    out = folder / "out.npz"
    render(encode_text(text, GridShape(6, 6), TextOptions()), load_device("paper-6x6"), out)
    return out, folder / "out.json"


def test_a_manifest_says_where_words_go_on_and_verify_joins_them(tmp_path):
    out, _ = rendered(tmp_path)
    manifest, _ = read_waveform(out)
    assert [mark.goes_on for mark in manifest.frames] == [(), (GoesOn(0, "⠐", "⠼"),), (), ()]
    report = verify(out)
    assert report.felt_text == "call 5550199 now"
    assert report.cells_equal
    assert report.differences == ()


def test_a_page_that_reads_otherwise_alone_is_listed_by_its_number(tmp_path):
    out, notes = rendered(tmp_path)
    manifest = json.loads(notes.read_text())
    # As if the third page had been meant to show the whole number.
    manifest["frames"][2]["text"] = "5550199"
    notes.write_text(json.dumps(manifest))
    assert "page 3: '5550199' read alone is '199'" in verify(out).differences


def test_a_manifest_of_old_is_still_read(tmp_path):
    out, notes = rendered(tmp_path, "knowledgeable")
    manifest = json.loads(notes.read_text())
    for frame in manifest["frames"]:
        frame.pop("goes_on", None)
    for key in ("continuation", "passages"):
        del manifest["encoding"][key]
    notes.write_text(json.dumps(manifest))
    report = verify(out)
    assert report.felt_text == "knowledgeable"
    assert report.cells_equal
