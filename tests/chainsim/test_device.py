"""Device profiles: what is built in, and what is said about a profile that cannot be used."""

import math
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from chainsim import Closure, Device, ProfileError, assumed_of, device_names, load_device, surroundings_of
from chainsim.model.calibrated import Actuator

GRID = {"scope": "link", "lam_y": {"min": 0, "max": 1}, "drives": "corner"}


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
    assert device.chains * device.chain_length == device.rows * device.cols
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


def test_a_grid_is_one_chain_with_several_drives():
    device = load_device("grid-6x6")
    assert (device.grid, device.chains, device.chain.rows, device.chain.cols, device.links) == (True, 1, 6, 6, 60)
    assert device.driven == (*((row, 0) for row in range(6)), *((0, col) for col in range(1, 6)))
    coupled = {where: device.coupling.model_copy(update={"drives": where}) for where in ("corner", "column")}
    assert [len(device.model_copy(update={"coupling": one}).driven) for one in coupled.values()] == [1, 6]
    assert "lam_y" in device.as_dict()["coupling"]
    assert "lam_y" not in load_device("linked-6x6").as_dict()["coupling"]


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
        ({"coupling": {"scope": "link", "lam_y": {"min": 0, "max": 1}}}, "coupling", "give both"),
        ({"coupling": {"scope": "link", "drives": "corner"}}, "coupling", "give both"),
        ({"coupling": {"scope": "link", "lam_y": {"min": 0, "max": 1}, "drives": "left"}}, "coupling.drives", "'left'"),
        ({"coupling": GRID | {"scope": "device"}}, "coupling", "expected chain or link"),
        ({"coupling": GRID | {"closure": "ring"}}, "coupling", "is open, got ring"),
        ({"coupling": GRID | {"bits": 8}}, "coupling", "remove bits or lam_y"),
        ({"coupling": GRID}, "file", "it is rows times cols, 36"),
        ({"coupling": GRID, "rows": 1}, "file", "no grid but a chain"),
        ({"coupling": GRID, "chain_length": 36, "bias": "actuator"}, "file", "takes bias none"),
        ({"coupling": GRID, "chain_length": 36, "spread": {"frequency": 0.01}}, "file", "remove spread"),
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


def test_a_file_that_is_edited_is_read_anew(tmp_path):
    path = written(tmp_path, profile(name="mine", rows=4))
    assert load_device(path).rows == 4
    assert written(tmp_path, profile(name="mine", rows=3)) == path
    assert load_device(path).rows == 3
    # What nobody edits is read once.
    assert load_device("paper-6x6") is load_device("paper-6x6")


def test_names_that_lead_nowhere(tmp_path):
    with pytest.raises(ProfileError, match=", ".join(device_names())):
        load_device("nosuch")
    with pytest.raises(ProfileError, match="No such file"):
        load_device(str(tmp_path / "nosuch.yaml"))
    (tmp_path / "latin.yaml").write_bytes("name: Gerät".encode("latin-1"))
    with pytest.raises(ProfileError, match="not UTF-8 at byte 9"):
        load_device(str(tmp_path / "latin.yaml"))


def measured(**others: Any) -> Device:
    """Row 1 of `linked-6x6`, or of a device with one lam per chain, measured in part."""
    device = load_device(others.pop("base", "linked-6x6"))
    actuators = (
        Actuator(row=1, col=0, f0_hz=device.f0_hz * 1.01, epsilon_per_volt=2.2e-3),
        Actuator(row=1, col=2, delta=6e-3, lam=0.0063, lam_set=0.006),
        Actuator(row=1, col=3, beta=-1.5, lam=0.0054, lam_set=0.006),
    )
    return device.model_copy(update={"actuators": actuators} | others)


def test_a_chain_alone_is_a_device_of_its_own() -> None:
    device = measured()
    alone = device.alone(1)
    assert (alone.rows, alone.cols, alone.chains_per_row) == (1, 6, 1)
    assert alone.chain == device.chain_at(1)
    assert alone.chain.stiffness[0] == pytest.approx(1.01**2)
    assert (alone.chain.deltas[2], alone.chain.betas[3]) == (6e-3, -1.5)
    np.testing.assert_allclose(alone.lam_gain(0), device.lam_gain(1))
    np.testing.assert_allclose(alone.lam_gain(0), [1, 1.05, 0.9, 1, 1])
    assert alone.epsilon_per_volt == 2.2e-3
    assert alone.escape_amplitude == pytest.approx(1.5**-0.5)
    assert alone.coupling == device.coupling
    # The device as a whole has chains of several kinds: what they have in common is the profile.
    assert device.chain == load_device("linked-6x6").chain


def test_chains_without_measurements_are_alike() -> None:
    device = measured()
    assert device.alone(0) == device.alone(5)
    assert device.alone(0).actuators == ()
    assert device.alone(0).chain == device.chain
    assert device.alone(0) != device.alone(1)


def test_one_lam_for_a_chain_is_counted_in_what_links_make_of_it() -> None:
    device = measured(base="paper-6x6")
    alone, mean = device.alone(1), np.mean([1, 1.05, 0.9, 1, 1])
    assert device.lam_unit(1) == pytest.approx(mean)
    assert device.lam_unit(0) == 1.0
    assert alone.coupling.lam.max == pytest.approx(device.coupling.lam.max * mean)
    np.testing.assert_allclose(alone.lam_gain(0), np.array([1, 1.05, 0.9, 1, 1]) / mean)


def test_spread_is_read_strictly_and_written_only_where_it_is() -> None:
    plain = load_device("linked-6x6")
    assert plain.spread is None
    assert "spread" not in plain.as_dict()
    told = Device.model_validate(plain.as_dict() | {"spread": {"frequency": 0.01}})
    assert told.spread is not None
    assert (told.spread.frequency, told.spread.damping, told.spread.beta, told.spread.lam) == (0.01, 0, 0, 0)
    assert Device.model_validate(told.as_dict()) == told
    for wrong in ({"f0": 0.01}, {"frequency": -0.01}, {"lam": 1.5}, {"beta": float("nan")}):
        with pytest.raises(ValidationError, match="spread"):
            Device.model_validate(plain.as_dict() | {"spread": wrong})


def test_a_copy_with_other_actuators_forgets_those_before() -> None:
    device = measured()
    assert device.drive_per_volt(1) == 2.2e-3
    other = device.model_copy(update={"actuators": (Actuator(row=1, col=0, epsilon_per_volt=2.5e-3),)})
    assert other.drive_per_volt(1) == 2.5e-3
    assert device.drive_per_volt(1) == 2.2e-3
    fresh = measured()
    assert fresh == device
    assert fresh.as_dict() == device.as_dict()
    assert fresh.model_dump_json() == device.model_dump_json()


@pytest.mark.parametrize("name", device_names())
def test_surroundings_of_the_profiles_are_what_is_assumed_without_the_section(name: str) -> None:
    device = load_device(name)
    assert device.surroundings is not None
    bare = Device.model_validate(device.as_dict() | {"surroundings": None, "notes": {}})
    assert "surroundings" not in bare.as_dict()
    told, assumed = surroundings_of(device), surroundings_of(bare)
    rest = {"modes": (), "saturation": None}
    assert told.model_copy(update=rest) == assumed.model_copy(update=rest)
    assert told.saturation == pytest.approx(assumed.saturation)
    for one, other in zip(told.modes, assumed.modes, strict=True):
        assert (one.omega, one.delta, one.gain) == pytest.approx((other.omega, other.delta, other.gain), rel=1e-4)
    assert assumed_of(device) == assumed_of(bare)
    assert {"hysteresis", "creep_per_decade", "modes", "bandwidth_hz", "spread"} <= set(assumed_of(device))


def test_what_is_measured_of_the_surroundings_is_not_assumed() -> None:
    notes = {
        "surroundings": {"assumed": True, "why": "?"},
        "surroundings.hysteresis": {"assumed": False, "why": "A loop at 50 V."},
    }
    section = {"hysteresis": 0.08, "bandwidth_hz": 5000.0}
    plain = load_device("linked-6x6").as_dict()
    device = Device.model_validate(plain | {"surroundings": section, "notes": notes})
    assert assumed_of(device) == ("bandwidth_hz",)
    around = surroundings_of(device)
    assert (around.hysteresis, around.bandwidth, around.largest_loop, around.modes) == (0.08, 5000.0, np.inf, ())
    # The spread that plans count on is what the devices have.
    spread = {"frequency": 0.002}
    told = Device.model_validate(plain | {"surroundings": section, "spread": spread, "notes": notes})
    assert surroundings_of(told).spread == told.spread


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"hysteresis": 1.0}, "surroundings.hysteresis"),
        ({"saturation": 0}, "surroundings.saturation"),
        ({"modes": [{"omega": 0, "delta": 0.1, "gain": 1}]}, "surroundings.modes.0.omega"),
        ({"noise": 1e-5}, "surroundings.noise"),
        ({"converter_bits": 1}, "surroundings.converter_bits"),
        ({"amplifier_noise": -1}, "surroundings.amplifier_noise"),
    ],
)
def test_surroundings_are_read_strictly(section: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words.replace("surroundings.", "")):
        Device.model_validate(load_device("linked-6x6").as_dict() | {"surroundings": section})
