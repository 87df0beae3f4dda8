"""Many devices at once: against the single chain with the same terms, and against the grid with none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import (
    Actuator,
    ActuatorSpread,
    AmplifierDynamics,
    AsBuilt,
    Chain,
    Creep,
    Device,
    DrawnDevices,
    HigherMode,
    Mode,
    Setting,
    Surroundings,
    Terms,
    integrate_terms,
    load_device,
)
from chainsim.drawn.acting import CommonAmplifier, plays_of

Floats = NDArray[np.float64]

LINKED = load_device("linked-6x6")
LOOP = Surroundings(hysteresis=0.1, saturation=0.0005)
SLOW = Surroundings(creep_per_decade=0.05, creep_first_s=5 / LINKED.tau_per_s)
BENT = Surroundings(modes=(HigherMode(omega=4.97, delta=0.03, gain=3.5), HigherMode(omega=9.45, delta=0.05, gain=5.7)))
TOUCHED = Surroundings(preload=0.001, touch_stiffness=0.02, touch_damping=0.003)


def device_of(rows: int = 1, n: int = 4, **changes: object) -> Device:
    return Device.model_validate(
        LINKED.as_dict() | {"rows": rows, "cols": n, "chain_length": n, "surroundings": None, "notes": {}} | changes
    )


def moved(
    device: Device, around: Surroundings, force: Floats, lam: Floats, at: list[int], *, count: int = 1, blocks: int = 1,
    seed: int = 0, first: int = 0, dtau: float = 0.005,
) -> Floats:  # fmt: skip
    """Tips at the samples `at`; float64, shape (count, len(at), rows, cols)."""
    drawn = DrawnDevices(
        device, around, first=first, count=count, seed=seed, rate_hz=device.tau_per_s / dtau, frames=1,
        weights=len(at),
    )  # fmt: skip
    basis = (np.arange(len(force))[:, None] == np.array(at)).astype(float)
    frame = np.zeros(len(force), dtype=np.int64)
    for part in np.array_split(np.arange(len(force)), blocks):
        every = np.broadcast_to(basis[part], (device.rows, len(part), len(at)))
        drawn.advance(force[part], lam[part], frame[part], every)
    return np.moveaxis(drawn.load[:, 0], -1, 1)


def driven(device: Device, samples: int, dtau: float = 0.005) -> tuple[Floats, Floats]:
    """A tone from the first sample on, and links that stay."""
    tau = dtau * np.arange(samples)
    force = np.zeros((samples, device.rows, device.cols))
    force[:, :, 0] = 0.003 * np.cos(1.1 * tau)[:, None]
    return force, np.full(force.shape, 0.3)


@pytest.mark.parametrize(
    ("around", "off"),
    [
        (Surroundings(), 5e-6),
        (LOOP, 2e-5),
        (SLOW, 5e-6),
        (BENT, 5e-6),
        (TOUCHED, 5e-6),
        (Surroundings.model_validate(LOOP.model_dump() | BENT.model_dump(include={"modes"})), 2e-5),
    ],
    ids=["nothing", "hysteresis", "creep", "modes", "fingertip", "hysteresis and modes"],
)
def test_each_effect_is_that_of_a_single_chain(around: Surroundings, off: float) -> None:
    """The single chain takes Runge-Kutta steps; samples that are joined by straight lines cost 2e-6."""
    device, samples = device_of(delta=0.05), 12001
    force, lam = driven(device, samples)
    at = [3000, 7000, 11000, 12000]
    found = moved(device, around, force, lam, at)[0, :, 0]
    chain = Chain.of(
        4, delta=device.delta + around.touch_damping, beta=device.beta, stiffness=1.0 + around.touch_stiffness
    )  # fmt: skip
    setting = Setting.of(chain, epsilon=0.003, lam=0.3, omega=1.1, preload=around.preload)
    first = around.creep_first_s * device.tau_per_s
    terms = Terms(
        hysteresis=plays_of(around) if around.hysteresis else None,
        creep=Creep(around.creep_per_decade, first, 1e3 * first) if around.creep_per_decade else None,
        modes=tuple(Mode(one.omega, one.delta, one.gain) for one in around.modes) or None,
    )
    motion = integrate_terms(chain, setting, terms, duration=60.0, step=0.005, every=1)
    wanted = motion.tip[np.array(at) - 1]
    assert np.abs(found - wanted).max() < off * np.abs(motion.tip).max()
    without = integrate_terms(device.chain, setting, Terms(), duration=60.0, step=0.005, every=1)
    if around != Surroundings():
        # Each effect is much larger than what it is known to.
        assert np.abs(wanted - without.tip[np.array(at) - 1]).max() > 100 * off * np.abs(motion.tip).max()


def test_the_loop_has_the_share_and_the_end_that_are_told() -> None:
    plays = plays_of(LOOP)
    assert sum(plays.weight) == pytest.approx(LOOP.hysteresis)
    assert plays.base == pytest.approx(1 - LOOP.hysteresis)
    assert np.dot(plays.weight, plays.radius) == pytest.approx(LOOP.saturation)
    # On the way up h follows the curve that saturates exponentially, to an eighth of its end.
    for force in np.linspace(0, 0.025, 41):
        h = sum(w * min(force, r) for w, r in zip(plays.weight, plays.radius, strict=True))
        assert h == pytest.approx(0.0005 * -math.expm1(-0.1 * force / 0.0005), abs=0.12 * 0.0005)
    endless = plays_of(Surroundings(hysteresis=0.1))
    assert (endless.base, sum(endless.weight)) == (0.9, 0.0)


@pytest.mark.parametrize("closure", ["open", "ring"])
def test_without_effects_each_device_is_the_grid(closure: str) -> None:
    """A coarser composition of the same equations; measured actuators count."""
    coupling = LINKED.coupling.model_dump() | {"closure": closure}
    measured = (
        Actuator(row=1, col=2, f0_hz=134.0, delta=0.006, lam=0.11, lam_set=0.1),
        Actuator(row=0, col=1, beta=-2),
    )
    device = device_of(2, 4, coupling=coupling, actuators=[one.model_dump() for one in measured])
    rng = np.random.default_rng(5)
    force = 1e-3 * rng.standard_normal((400, 2, 4))
    lam = 0.02 + 0.005 * rng.standard_normal(force.shape)
    built = AsBuilt(device)
    z = built.integrator(device.tau_per_s / 0.1).advance(force, lam * built.lam_gain)
    found = moved(device, Surroundings(), force, lam, [1, 60, 399], count=3, blocks=4, dtau=0.1)
    assert np.abs(found - z[[1, 60, 399]]).max() < 2e-5 * np.abs(z).max()


@pytest.mark.parametrize("around", [Surroundings(), BENT], ids=["nothing else", "modes"])
def test_rows_are_coupled_as_in_the_grid(around: Surroundings) -> None:
    """A drive on the first row alone; the grid takes Runge-Kutta steps."""
    device, samples = device_of(3, delta=0.05), 8001
    force, lam = driven(device, samples)
    force[:, 1:] = 0.0
    coupled = around.model_copy(update={"row_lam": 0.1})
    found = moved(device, coupled, force, lam, [3000, 8000], count=17, blocks=3)
    chain = Chain.of(12, delta=device.delta, beta=device.beta, stiffness=1.0, rows=3)
    setting = Setting.of(chain, epsilon=0.003, lam=np.full((3, 3), 0.3), lam_y=0.1, omega=1.1)
    terms = Terms(modes=tuple(Mode(one.omega, one.delta, one.gain) for one in around.modes) or None)
    motion = integrate_terms(chain, setting, terms, duration=40.0, step=0.005, every=1)
    wanted = motion.tip[np.array([3000, 8000]) - 1].reshape(2, 3, 4)
    assert np.abs(found[16] - wanted).max() < 5e-6 * np.abs(motion.tip).max()
    assert np.abs(wanted[:, 2]).max() > 1e-3 * np.abs(motion.tip).max()


def test_steps_as_long_as_they_get_are_right_beside_loops_with_corners() -> None:
    """The same lines between samples, by steps as long as they get and by steps an eighth of that."""
    device, samples, finer = device_of(delta=0.05, bias="actuator"), 1201, 8
    around = Surroundings.model_validate(LOOP.model_dump() | BENT.model_dump(include={"modes"}))
    force, lam = driven(device, samples, dtau=0.12)
    force[..., 1:] = 0.1
    at, fine = np.array([500, 900, 1200]), np.arange((samples - 1) * finer + 1) / finer
    between = np.array([np.interp(fine, np.arange(samples), one) for one in force[:, 0].T]).T[:, None]
    found = moved(device, around, force, lam / 10, at.tolist(), dtau=0.12)
    wanted = moved(device, around, between, np.full(between.shape, 0.03), (finer * at).tolist(), dtau=0.12 / finer)
    assert np.abs(found - wanted).max() < 3e-4 * np.abs(wanted).max()


def test_a_device_is_the_same_in_whatever_company_and_blocks() -> None:
    around = LOOP.model_copy(
        update={"amplifier_noise": 1e-4, "spread": ActuatorSpread(frequency=0.01, damping=0.05, beta=0.1, lam=0.02)}
    )
    device = device_of(2, 3)
    force, lam = driven(device, 400, dtau=0.1)
    whole = moved(device, around, force, lam, [200, 399], count=40, seed=3, dtau=0.1)
    alone = moved(device, around, force, lam, [200, 399], count=1, first=37, seed=3, blocks=7, dtau=0.1)
    assert np.array_equal(whole[37], alone[0])
    other = moved(device, around, force, lam, [200, 399], count=1, first=37, seed=4, dtau=0.1)
    assert np.abs(other - alone).max() > 1e-4 * np.abs(alone).max()


def test_draws_scatter_as_told() -> None:
    """Static answers of single actuators under a bias, by stiffness; a link alone by its gain."""
    device = device_of(8, 1, delta=0.9, beta=0.0, coupling={"scope": "none"})
    force, lam = np.full((300, 8, 1), 0.01), np.zeros((300, 8, 1))
    around = Surroundings(spread=ActuatorSpread(frequency=0.01))
    z = moved(device, around, force, lam, [299], count=400, dtau=0.1)[:, 0]
    stiffness = 0.01 / z
    assert stiffness.mean() == pytest.approx(1.0, abs=0.002)
    assert stiffness.std() == pytest.approx(0.02, rel=0.06)
    assert abs(np.corrcoef(stiffness[:, 0, 0], stiffness[:, 1, 0])[0, 1]) < 0.2


def test_noise_has_the_rms_that_is_told_and_no_memory() -> None:
    """Of actuators that follow a force at once the tips are the noise itself, but for its fastest part."""
    device = device_of(1, 2, delta=0.9, beta=0.0, bias="actuator", f0_hz=133.13, chain_length=2)
    silence = np.zeros((4000, 1, 2))
    around = Surroundings(amplifier_noise=1e-3)
    # Slow samples: the motion settles between two of them.
    at = list(range(200, 4000, 20))
    z = moved(device, around, silence, silence, at, count=8, dtau=12.0)[:, :, 0]
    force = 1e-3 * device.amplifier.volts * device.epsilon_per_volt
    # The first actuator has a drive and a bias channel.
    assert z[..., 1].std() == pytest.approx(force, rel=0.1)
    assert z[..., 0].std() == pytest.approx(force * math.sqrt(2), rel=0.1)
    assert abs(z.mean()) < 0.1 * force
    for one, other in ((z[:, 1:, 1], z[:, :-1, 1]), (z[..., 0], z[..., 1]), (z[:4], z[4:])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.1


def test_a_device_that_escapes_lies_still_and_says_when() -> None:
    device = device_of(2, 2)
    force, lam = driven(device, 3000, dtau=0.1)
    force[:, 1] *= 400.0
    drawn = DrawnDevices(
        device, Surroundings(), first=0, count=2, seed=0, rate_hz=device.tau_per_s / 0.1, frames=1, weights=1
    )
    last = (np.arange(3000) == 2999).astype(float)
    frame = np.where(np.arange(3000) < 2000, -1, 0)
    drawn.advance(force, lam, frame, np.broadcast_to(last[:, None], (2, 3000, 1)))
    assert (drawn.escaped > 0).all()
    assert (drawn.escaped < 1000).all()
    # It counts as not felt; the other row is as ever.
    assert np.array_equal(drawn.load[:, 0, 1], np.zeros((2, 2, 1)))
    assert (np.abs(drawn.load[:, 0, 0]) > 0).all()


def test_the_amplifier_is_that_of_the_terms_and_rounds_to_its_steps() -> None:
    device = device_of()
    rate, around = device.amplifier.rate_hz, Surroundings(bandwidth_hz=2000.0)
    volts = 20 * np.sin(2 * np.pi * 150 * np.arange(4800) / rate)[:, None]
    amplifier = CommonAmplifier(device, around)
    made = np.concatenate([amplifier.advance(part) for part in np.array_split(volts, 5)])
    late = np.arange(2400, 4800)
    phasor = 2 * np.mean(made[late, 0] * np.exp(-2j * np.pi * 150 * late / rate))
    terms = AmplifierDynamics(2000.0 / device.f0_hz)
    factor = 1 / (1 + 1j * 150 / device.f0_hz / terms.bandwidth)
    assert phasor == pytest.approx(-20j * factor, abs=0.01)
    rounded = CommonAmplifier(device, Surroundings(converter_bits=8)).advance(volts)
    step = device.amplifier.volts / 127
    assert np.abs(rounded - volts).max() <= step / 2
    assert np.array_equal(rounded, step * np.rint(rounded / step))
