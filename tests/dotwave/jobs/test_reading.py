"""Job files are read strictly: every complaint names file, line, field, what was expected and what was found."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent
from typing import Any, get_args

import jsonschema
import pytest
import yaml
from pydantic import ValidationError

from chainsim import ProfileError, load_device
from dotwave.jobs.job import Job, PicturePart, job_schema, read_job
from encoders import GridShape, Region as TextureRegion, picture_rules, plane_wave, regions

JOBS = sorted((Path(__file__).resolve().parents[3] / "samples" / "jobs").glob("*.yaml"))

THE_ISSUES_OWN = """\
# A job
schema: dotwave/job/1
tolerance: normal
output: x.wav

sequence:
  - text: Hello

# and its device

device:
  base: linked-6x6
  grid:
    rows: six
"""

WRONG = {
    "sequence: []": "1: sequence: expected at least one item such as '- text: Hello', got none",
    "device: paper-6x6": "1: sequence: this key is required and missing",
    "sequence: [{text: a}]\ntext: b": "2: text: unknown key; remove it or correct its spelling",
    "sequence:\n  - text: {say: a, file: b}": "2: sequence.0.text: give either say (the words) or file",
    "sequence:\n  - {text: a, pause_s: 1}": "2: sequence.0: give exactly one of text, image, icon, texture, pause_s",
    "sequence:\n  - text:": "2: sequence.0: give exactly one of text, image, icon, texture, pause_s",
    "sequence:\n  - pause_s: -1": "2: sequence.0.pause_s: expected a number > 0.0, got -1",
    "sequence:\n  - image: {file: a.png,\n      zoom: 99}": (
        "3: sequence.0.image.zoom: expected a number <= 16, got 99"
    ),
    "sequence:\n  - icon: {file: a, background: red}": "2: sequence.0.icon.background: expected auto or a colour",
    "sequence:\n  - icon: {fit: tight, file: a}": (
        "2: sequence.0.icon.fit: expected 'contain', 'cover' or 'stretch', got 'tight'"
    ),
    "sequence:\n  - texture:\n      wave: {lag_deg: 60, lvl: 1}": "3: sequence.0.texture.wave.lvl: unknown key",
    "sequence:\n  - texture: {dwell_s: 1}": "2: sequence.0.texture: give exactly one of wave, bars, slanted_bars",
    "sequence:\n  - texture:\n      levels: [[1, 2]]": "3: sequence.0.texture.levels.0.1: expected a number <= 1.0",
    "tolerance: high\nsequence: [{pause_s: 1}]": (
        "1: tolerance: expected 'draft', 'normal', 'fine' or a number > 0 such as 1e-3, got 'high'"
    ),
    "tolerance: 0\nsequence: [{pause_s: 1}]": "1: tolerance: expected 'draft', 'normal', 'fine' or a number > 0 such",
    "tolerance: yes\nsequence: [{pause_s: 1}]": "1: tolerance: expected 'draft', 'normal', 'fine' or a number > 0",
    "budget: {planning_s: 0}\nsequence: [{pause_s: 1}]": "1: budget.planning_s: expected a number > 0.0, got 0",
    "device: nope\nsequence: [{pause_s: 1}]": "1: device: device 'nope': not a built-in profile (",
    "device: {grid: {cols: 0}}\nsequence: [{pause_s: 1}]": (
        "1: device.grid.cols: expected a whole number from 1 to 1024, got 0"
    ),
    "device: {full_scale: 5}\nsequence: [{pause_s: 1}]": "1: device: full_scale 5.0 is beyond the softening hilltop",
    "device: {chain_length: 4}\nsequence: [{pause_s: 1}]": "1: device: chain_length 4 does not divide cols 6",
    "device: {base: linked-6x6, actuators: [{row: 9, col: 0}]}\nsequence: [{pause_s: 1}]": (
        "1: device: actuators.0: row 9, col 0 is outside the grid of 6 x 6"
    ),
    "device:\n  actuators:\n    - {row: 0, col: 1, f0: 131}\nsequence: [{pause_s: 1}]": (
        "3: device.actuators.0.f0: unknown key"
    ),
    "sequence: {text: a}": "1: sequence: expected a list, got {'text': 'a'}",
    "sequence: [{texture: {levels: 3}}]": "1: sequence.0.texture.levels: expected a list, got 3",
    "device: {spread: [1]}\nsequence: [{pause_s: 1}]": "1: device.spread: expected keys and values, got [1]",
    "device: {coupling: {scope: both}}\nsequence: [{pause_s: 1}]": "1: device.coupling.scope: expected",
}


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "job.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_message_of_the_issue_word_for_word(tmp_path: Path) -> None:
    with pytest.raises(ProfileError) as caught:
        read_job(written(tmp_path, THE_ISSUES_OWN))
    place = f"{tmp_path}/job.yaml:14: device.grid.rows: "
    assert str(caught.value) == place + "expected a whole number from 1 to 1024, got 'six'"


@pytest.mark.parametrize("text", WRONG)
def test_complaints_name_the_place_and_the_cure(tmp_path: Path, text: str) -> None:
    with pytest.raises(ProfileError) as caught:
        read_job(written(tmp_path, text))
    assert str(caught.value).startswith(f"{tmp_path}/job.yaml:{WRONG[text]}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("device", "says"),
    [
        ("{name: ''}", "name: expected text of 1 characters or more, got ''"),
        ("{delta: 2}", "delta: expected a number < 1.0, got 2.0"),
        ("{spread: {frequency: 2}}", "spread.frequency: expected a number <= 1.0, got 2.0"),
    ],
)
def test_what_its_base_makes_wrong_is_said_in_the_same_words(tmp_path: Path, device: str, says: str) -> None:
    with pytest.raises(ProfileError) as caught:
        read_job(written(tmp_path, f"device: {device}\nsequence: [{{pause_s: 1}}]"))
    assert str(caught.value) == f"{tmp_path}/job.yaml:1: device: {says}"


@pytest.mark.parametrize("rows", ["6.0", "true", "'6'", "1025", "null0"])
def test_only_whole_numbers_count_actuators(tmp_path: Path, rows: str) -> None:
    with pytest.raises(ProfileError, match="expected a whole number from 1 to 1024, got "):
        read_job(written(tmp_path, f"device: {{grid: {{rows: {rows}}}}}\nsequence: [{{pause_s: 1}}]"))


def test_an_inline_device_knows_its_actuators(tmp_path: Path) -> None:
    text = """\
        device:
          base: linked-6x6
          actuators:
            - {row: 0, col: 0, f0_hz: 131.9, epsilon_per_volt: 2.1e-3, plus_minus: {f0_hz: 0.01}}
            - {row: 0, col: 1, lam: 0.52, lam_set: 0.5}
        sequence: [{pause_s: 1}]
        """
    device = read_job(written(tmp_path, dedent(text))).device.device(tmp_path)
    assert device.chain_at(0).stiffness[0] == pytest.approx((131.9 / 133.13) ** 2)
    assert device.lam_gain(0).tolist() == [1.04, 1.0, 1.0, 1.0, 1.0]
    assert device.drive_per_volt(0) == 2.1e-3
    assert device.actuators[0].plus_minus.f0_hz == 0.01
    # They stand in the place of the base's own.
    mine = tmp_path / "mine.yaml"
    mine.write_text(yaml.safe_dump(device.as_dict()), encoding="utf-8")
    text = "device: {base: mine.yaml, actuators: [{row: 5, col: 5, delta: 6.0e-3}]}\nsequence: [{pause_s: 1}]"
    again = read_job(written(tmp_path, text)).device.device(tmp_path)
    assert [(one.row, one.col) for one in again.actuators] == [(5, 5)]
    assert (
        len(
            read_job(written(tmp_path, "device: mine.yaml\nsequence: [{pause_s: 1}]")).device.device(tmp_path).actuators
        )
        == 2
    )


def test_an_inline_device_is_its_base_with_changes(tmp_path: Path) -> None:
    text = (
        "device: {base: linked-6x6, grid: {rows: 3, cols: 12, pitch_m: 2.5e-3}, f0_hz: 250}\nsequence: [{pause_s: 1}]"
    )
    device = read_job(written(tmp_path, text)).device.device(tmp_path)
    base = load_device("linked-6x6")
    assert (device.rows, device.cols, device.chain_length) == (3, 12, 12)
    assert (device.pitch_m, device.f0_hz) == (2.5e-3, 250)
    assert (device.coupling, device.amplifier, device.delta) == (base.coupling, base.amplifier, base.delta)
    kept = "device: {base: linked-6x6, grid: {cols: 12}, chain_length: 6}\nsequence: [{pause_s: 1}]"
    assert read_job(written(tmp_path, kept)).device.device(tmp_path).chains_per_row == 2


def test_a_device_file_is_looked_for_beside_the_job(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(
        (Path(__file__).resolve().parents[3] / "chainsim/model/profiles/linked-6x6.yaml")
        .read_text(encoding="utf-8")
        .replace("name: linked-6x6", "name: mine"),
        encoding="utf-8",
    )
    job = read_job(written(tmp_path, "device: mine.yaml\nsequence: [{pause_s: 1}]"))
    assert job.device.device(tmp_path).name == "mine"
    assert read_job(written(tmp_path, "sequence: [{pause_s: 1}]")).device.device(tmp_path) == load_device("paper-6x6")


def test_short_and_long_forms_are_the_same(tmp_path: Path) -> None:
    short = read_job(written(tmp_path, "device: linked-6x6\nsequence: [{text: Hi}, {icon: a.svg}]"))
    long = "device: {base: linked-6x6}\nsequence: [{text: {say: Hi}}, {icon: {file: a.svg}}]"
    assert short == read_job(written(tmp_path, long))


def test_textures_are_those_of_the_encoder(tmp_path: Path) -> None:
    text = "sequence: [{texture: {regions: [{top: 0, bottom: 2, left: 1, right: 3, wave: {lag_deg: 90}}]}}]"
    texture = read_job(written(tmp_path, text)).sequence[0].texture
    assert texture is not None
    shape = GridShape(3, 4)
    wanted = regions(shape, [TextureRegion(0, 2, 1, 3, plane_wave(shape, lag_deg=90))])
    assert (next(iter(texture.scene(shape).frames)).pattern.amplitude == wanted.amplitude).all()


def names_in(schema: dict[str, Any], names: set[str]) -> set[str]:
    for key, value in schema.items():
        if key == "properties":
            names |= set(value)
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, dict):
                names_in(part, names)
    return names


def test_the_schema_knows_every_key_and_the_short_forms() -> None:
    schema = job_schema()
    assert schema["$schema"].startswith("https://json-schema.org/")
    names = names_in(schema, set())
    for model in [Job, *get_args(Job.model_fields["sequence"].annotation)[:1]]:
        assert {field.alias or name for name, field in model.model_fields.items()} <= names
    assert {"say", "planning_s", "lag_deg", "walking_bars", "pitch_m", "chain_length"} <= names
    assert "short" not in names
    assert schema["required"] == ["sequence"]
    assert schema["additionalProperties"] is False


@pytest.mark.parametrize("path", JOBS, ids=lambda path: path.stem)
def test_samples_fit_the_schema(path: Path) -> None:
    jsonschema.validate(yaml.safe_load(path.read_text(encoding="utf-8")), job_schema())


@pytest.mark.parametrize(
    "text", [text for text, words in WRONG.items() if "unknown key" in words or "expected" in words]
)
def test_the_schema_refuses_what_the_reader_refuses(text: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(yaml.safe_load(text), job_schema())


@pytest.mark.parametrize(
    ("words", "tol"), [("draft", 0.1), ("normal", 0.02), ("fine", 0.005), ("1e-3", 1e-3), ("1.0e-3", 1e-3), ("2", 2.0)]
)
def test_tolerances_by_name_and_number(tmp_path: Path, words: str, tol: float) -> None:
    assert read_job(written(tmp_path, f"tolerance: {words}\nsequence: [{{pause_s: 1}}]")).tol == tol


def picture_part(name: str, value: Any) -> PicturePart:
    return PicturePart(**{"file": "x.png", name: value})


def test_a_picture_has_the_options_of_the_encoder_with_their_ranges_and_defaults() -> None:
    part = PicturePart(file="x.png")
    told = {name: getattr(part, name) for name in PicturePart.model_fields if name != "file"}
    rules = {name: rule for name, rule in picture_rules().items() if name not in {"pitch_m", "candidates"}}
    assert told == {name: rule.default for name, rule in rules.items()}
    ranged = 0
    for name, rule in rules.items():
        if rule.span is not None:
            ranged += 1
            for good in (rule.span.low, rule.span.high):
                number = int(good) if isinstance(rule.default, int) else good
                assert getattr(picture_part(name, number), name) == number
            for bad in (rule.span.low - 1, rule.span.high + 1):
                with pytest.raises(ValidationError, match=name):
                    picture_part(name, bad)
        for word in rule.choices:
            assert getattr(picture_part(name, word), name) == word
    assert ranged == 10
