"""Device profiles: what is built in, and what is said about a profile that cannot be used."""

import math

import pytest
import yaml

from chainsim import Closure, Device, ProfileError, device_names, load_device


def profile(**changes):
    data = load_device("linked-6x6").as_dict()
    data.update(changes)
    return data


def written(tmp_path, data):
    path = tmp_path / "mine.yaml"
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data, sort_keys=False), "utf-8")
    return str(path)


@pytest.mark.parametrize("name", device_names())
def test_built_in_profiles(name):
    device = load_device(name)
    assert device.name == name
    assert device.cols % device.chain_length == 0
    assert device.beta == -1
    assert device.full_scale < device.escape_amplitude
    assert {"delta", "beta", "full_scale", "epsilon_per_volt"} <= {
        key for key, note in device.notes.items() if note.assumed
    }
    assert not device.notes["f0_hz"].assumed
    assert Device.model_validate(device.as_dict()) == device


def test_the_five_of_the_design_are_there():
    assert {"paper-6x6", "linked-6x6", "independent-6x6", "paper-6x6-ring", "linked-40x96"} <= set(device_names())
    assert load_device("paper-6x6-ring").coupling.closure is Closure.RING
    assert load_device("independent-6x6").chains_per_row == 6
    assert load_device("linked-40x96").chains_per_row == 16


def test_units():
    device = load_device("paper-6x6")
    assert device.tau_per_s == pytest.approx(2 * math.pi * 133.13)
    assert device.epsilon_max == pytest.approx(100 * device.epsilon_per_volt)
    assert device.chain.n == 6
    assert 1 / device.delta == pytest.approx(188.66, abs=0.01)


def test_a_file_of_ones_own(tmp_path):
    device = load_device(written(tmp_path, profile(name="mine", rows=4)))
    assert (device.name, device.rows) == ("mine", 4)


@pytest.mark.parametrize(
    ("changes", "field", "says"),
    [
        ({"rows": "six"}, "rows", "expected a whole number, got 'six'"),
        ({"rows": 0}, "rows", ">= 1"),
        ({"delta": "high"}, "delta", "expected a number, got 'high'"),
        ({"delta": float("nan")}, "delta", "got nan"),
        ({"amplifier": {"volts": 0, "slew_v_per_s": 1, "rate_hz": 8000}}, "amplifier.volts", "> 0"),
        ({"coupling": {"scope": "everything"}}, "coupling.scope", "'everything'"),
        ({"omega": {"min": 1.2, "max": 1.0}}, "omega", "swap them"),
        ({"colour": "red"}, "colour", "unknown key"),
        ({"chain_length": 4}, "file", "does not divide"),
        ({"full_scale": 1.5}, "file", "hilltop"),
        ({"notes": {"weight": {"assumed": True, "why": "?"}}}, "file", "no such field"),
    ],
)
def test_bad_values_name_file_line_and_field(tmp_path, changes, field, says):
    path = written(tmp_path, profile(**changes))
    with pytest.raises(ProfileError) as caught:
        load_device(path)
    message = str(caught.value)
    place, line, rest = message.removeprefix(path).split(":", 2)
    assert place == ""
    assert rest.strip().startswith(f"{field}:")
    assert says in message
    if field != "file":
        key = field.split(".")[0]
        assert key in (tmp_path / "mine.yaml").read_text().splitlines()[int(line) - 1] or "." in field
    assert "\n" not in message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rows: [1", "mine.yaml:1: not YAML"),
        ("- a\n- b\n", "keys and values"),
        ("", "keys and values"),
        ("rows: 6\nrows: 7\n", "mine.yaml:2: a key is given twice"),
        ("!!python/object:os.system {}", "not YAML"),
        ("rows: 6\n", "this key is required and missing"),
        ("a: &a [*a]\n", "mine.yaml"),
    ],
)
def test_files_that_are_no_profile(tmp_path, text, says):
    with pytest.raises(ProfileError, match=r"mine\.yaml") as caught:
        load_device(written(tmp_path, text))
    assert says in str(caught.value)


def test_names_that_lead_nowhere(tmp_path):
    with pytest.raises(ProfileError, match="linked-6x6, paper-6x6"):
        load_device("nosuch")
    with pytest.raises(ProfileError, match="No such file"):
        load_device(str(tmp_path / "nosuch.yaml"))
    (tmp_path / "latin.yaml").write_bytes("name: Gerät".encode("latin-1"))
    with pytest.raises(ProfileError, match="not UTF-8 at byte 9"):
        load_device(str(tmp_path / "latin.yaml"))
