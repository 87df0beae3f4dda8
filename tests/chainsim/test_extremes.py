"""Hostile inputs: an Outcome or a ValueError, never a NaN marked ok; the right answer by mpmath where there is one."""

import itertools

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chainsim import Chain, Outcome, Setting, solve
from tests.support.hostile import ESCAPE, HOSTILE, SYSTEMS, built, fold

STEADY = ["static", "linear", "one_harmonic", "harmonic_balance"]
BETAS = [0.0, 1.0, -1.0, -1e6, -1e12, 1e-300, -5e-324, 1e300]
DELTAS = [0.0, 1e-9, 5e-3, 3.0]
mp = mpmath.mp.clone()
mp.dps = 60


def sane(response):
    for index in range(len(response)):
        assert isinstance(response.outcome[index], Outcome)
        assert response.outcome[index].sentence
        if response.outcome[index] is Outcome.OK:
            assert np.isfinite(response.harmonics[index]).all()
            assert np.isfinite(response.mean[index]).all()
            assert np.isfinite(response.multipliers[index]).all()
            assert np.isfinite(response.error_estimate[index])
            assert response.stable[index]


@pytest.mark.parametrize("rung", STEADY)
@pytest.mark.parametrize("n", [1, 2, 64])
@pytest.mark.parametrize("beta", BETAS)
def test_hostile_settings(rung, n, beta):
    top = ESCAPE / np.sqrt(abs(beta)) if beta else 1.0
    points = list(
        itertools.product([0.0, 1e-200, 1e-3, 0.999 * top, top, 1.001 * top, 1e150], [0.0, 0.01], [0.3, 1.0, 1e3])
    )
    epsilon, lam, omega = np.array(points[:: 1 if n == 1 else 3]).T
    for delta in DELTAS if n < 64 else DELTAS[2:3]:
        chain = Chain(n, delta, beta)
        setting = Setting.of(chain, epsilon=epsilon, lam=lam[:, None], omega=omega)
        sane(solve(chain, setting, tol=1e-6, rung=rung))


@pytest.mark.parametrize("beta", [0.0, -1.0, 1.0, -1e12])
def test_auto_at_the_edge_of_the_well(beta):
    chain = Chain(2, 0.05, beta)
    top = ESCAPE / np.sqrt(abs(beta)) if beta else 1.0
    setting = Setting.of(chain, epsilon=[0.0, 1e-3 * top, 0.9 * top, top, 1.1 * top, 1e3 * top], lam=0.1, omega=1.0)
    response = solve(chain, setting, tol=1e-6)
    sane(response)
    assert response.outcome[1] is Outcome.OK
    assert response.outcome[-1] is (Outcome.ESCAPED if beta < 0 else response.outcome[-1])


@pytest.mark.parametrize("rung", STEADY)
def test_slow_drive_within_budget(rung):
    chain = Chain(2, 0.1, -1.0)
    sane(solve(chain, Setting.of(chain, epsilon=0.2, lam=0.1, omega=1e-3), tol=1e-6, rung=rung))


@pytest.mark.parametrize("rung", STEADY)
def test_constant_forces_of_every_size(rung):
    chain = Chain(3, 0.02, -1.0)
    setting = Setting.of(
        chain, epsilon=0.01, lam=0.1, omega=1.1, preload=[0.0, 1e-12, 0.1, 0.38, 0.39, 5.0, 1e200], bias=0.01
    )
    sane(solve(chain, setting, tol=1e-6, rung=rung))


def test_no_damping_never_locks_from_rest():
    chain = Chain(1, 0.0, 0.0)
    setting = Setting.of(chain, epsilon=1e-3, lam=0, omega=[1.0, 1.2])
    assert solve(chain, setting, tol=1e-6).outcome.tolist() == [Outcome.ESCAPED, Outcome.NOT_LOCKED]


@pytest.mark.parametrize("bad", [{"omega": 0.0}, {"epsilon": np.nan}, {"lam": np.inf}, {"phase": np.nan}])
def test_bad_numbers_are_value_errors(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        Setting.of(Chain(2, 0.01, -1.0), **{"epsilon": 1e-3, "lam": 0.01, "omega": 1.0, **bad})


def test_work_is_counted_and_bounded():
    chain = Chain(6, 6.1e-3, -1.0)
    setting = Setting.of(chain, epsilon=4e-4, lam=6.131e-3, omega=1.0)
    stats = solve(chain, setting, tol=1e-6, rung="harmonic_balance").stats
    assert stats.oscillators_solved == 6
    assert 6 <= stats.newton_steps <= 24
    assert stats.periods == 0


def linear_system(chain, setting):
    """Phasors and means of the chain without its cubic term, by elimination with 60 digits."""
    n, omega = chain.n, mp.mpf(float(setting.omega[0]))
    deltas, own = (np.broadcast_to(each, n) for each in (chain.deltas, chain.stiffness))
    matrix, still = mp.matrix(n, n), mp.matrix(n, n)
    for m in range(n):
        links = [(m - 1, float(setting.lam[0, m]))] if m or chain.closure == "ring" else []
        if setting.lam_y is not None and m >= chain.cols:
            links.append((m - chain.cols, float(setting.lam_y[0, m])))
        if chain.closure == "bidirectional" and m + 1 < n:
            links.append((m + 1, float(setting.lam[0, m + 1])))
        back = sum(mp.mpf(lam) for _, lam in links) if chain.kind == "resistor" else 0
        still[m, m] += mp.mpf(float(own[m])) + back
        matrix[m, m] += mp.mpf(float(own[m])) + back - omega**2 + 1j * mp.mpf(float(deltas[m])) * omega
        for source, lam in links:
            matrix[m, source % n] -= mp.mpf(lam)
            still[m, source % n] -= mp.mpf(lam)
    push, load = mp.matrix(n, 1), mp.matrix(n, 1)
    push[0], load[0] = mp.mpf(float(setting.epsilon[0])), mp.mpf(float(setting.preload[0]))
    return [complex(a) for a in mp.lu_solve(matrix, push)], [float(c) for c in mp.lu_solve(still, load)]


@pytest.mark.parametrize("system", list(SYSTEMS))
def test_linear_chains_against_sixty_digits(system):
    judged = 0
    for extreme in HOSTILE:
        if extreme.get("n", 6) > 6:
            continue
        chain, setting = built(system, extreme | {"beta": 0.0})
        found = solve(chain, setting, tol=1e-6, rung="linear", start="ramp")
        if not found.locked[0] or found.error_estimate[0] > 1e-3:
            continue
        phasor, mean = linear_system(chain, setting)
        size = max(*np.abs(phasor), *np.abs(mean))
        away = max(np.abs(found.phasor[0] - phasor).max(), np.abs(found.mean[0] - mean).max())
        assert away <= (found.error_estimate[0] + 1e-15) * size + 5e-323, extreme
        judged += 1
    assert judged >= 30


@pytest.mark.parametrize("system", list(SYSTEMS))
def test_faint_motions_are_the_linear_ones(system):
    """Where the cubic term's share is below 1e-13 harmonic balance has the linear chain's answer, whatever else."""
    extremes = [{"omega": value} for value in (1e3, 1e6)]
    extremes += [{"epsilon": 5e-324}, {"epsilon": 1e-200}, {"beta": 1e-300}, {"beta": -5e-324}]
    faint = ({"delta": 1e-12}, {"delta": 1e6}, {"lam": 1e-12}, {"omega": 1e-6})
    extremes += [{"epsilon": 1e-9, **each} for each in faint]
    for extreme in extremes:
        chain, setting = built(system, extreme)
        found = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
        phasor, _ = linear_system(chain, setting)
        away = np.abs(found.phasor[0] - phasor).max()
        # Of a denormal force only some bits are left.
        assert away <= 1e-11 * np.abs(phasor).max() + 5e-323, extreme


@pytest.mark.parametrize("beta", [-1.0, 1.0, -1e12, 1e-12])
def test_one_harmonic_against_the_cubic_with_fifty_digits(beta):
    length = np.sqrt(abs(beta))
    end = fold(5e-3, 0.985)
    points = [(5e-3, 0.985, end * (1 + by)) for by in (-1e-6, -1e-12, 1e-12, 1e-6)]
    omegas = [1e-6, 1e-3, 0.9, np.nextafter(1.0, 0), 1e3]
    points += itertools.product([1e-12, 5e-3, 1.0, 1e6], omegas, [1e-12, 1e-3, 3.0])
    for delta, omega, force in points:
        chain = Chain(1, delta, beta)
        epsilon = force / length
        found = solve(chain, Setting.of(chain, epsilon=epsilon, lam=0, omega=omega), tol=1e-6, rung="one_harmonic")
        if not found.locked[0]:
            continue
        kappa, g = 1 - mp.mpf(omega) ** 2, mp.mpf(delta) * mp.mpf(omega)
        strength = 3 * mp.mpf(beta) / 4
        # In v = 3/4 |beta| A^2, whose cubic is of ordinary size.
        push, sign = abs(strength) * mp.mpf(epsilon) ** 2, mp.sign(strength)
        roots = mp.polyroots(
            [-push, kappa**2 + g**2, 2 * sign * kappa, mp.mpf(1)], asc=True, maxsteps=2000, extraprec=600
        )
        real = [abs(mp.re(root)) for root in roots if abs(mp.im(root)) <= mp.mpf(10) ** -15 * abs(root)]
        mine = abs(found.phasor[0, 0])
        nearest = min(abs(mine - float(mp.sqrt(root / abs(strength)))) for root in real)
        # At a fold the answer is the square root of rounding; elsewhere rounding over the sharpness.
        slack = 2e-6 if abs(force - end) <= 1e-5 * end else 1e-12 + 1e-15 / max(delta * omega, 1e-12)
        assert nearest <= slack * mine, (delta, omega, force)


@pytest.mark.parametrize(("beta", "epsilon"), [(-1.0, 0.2), (1.0, 0.8), (-1e12, 2e-7)])
def test_a_drive_far_below_resonance_follows_the_static_curve(beta, epsilon):
    """z + beta z^3 = epsilon cos theta at each instant; its harmonics by the trapezoidal rule, which is exact here."""
    chain = Chain(1, 1e-9, beta)
    found = solve(chain, Setting.of(chain, epsilon=epsilon, lam=0, omega=1e-6), tol=1e-10, rung="harmonic_balance")
    theta = [2 * mp.pi * k / 128 for k in range(128)]
    z = [mp.findroot(lambda c, t=t: c + beta * c**3 - epsilon * mp.cos(t), epsilon * mp.cos(t)) for t in theta]
    for harmonic in (1, 3):
        wanted = sum(value * mp.cos(harmonic * t) for value, t in zip(z, theta, strict=True)) / 64
        assert found.harmonics[0, harmonic - 1, 0].real == pytest.approx(float(wanted), rel=1e-9)


@pytest.mark.parametrize("beta", [-1.0, 1.0])
def test_an_overdamped_oscillator_relaxes_as_dop853_says(beta):
    """delta omega = 1 and omega = 1e-6: z' = epsilon cos theta - z - beta z^3 in theta, inertia 1e-12 of it."""
    chain = Chain(1, 1e6, beta)
    found = solve(chain, Setting.of(chain, epsilon=0.4, lam=0, omega=1e-6), tol=1e-10)
    assert found.outcome[0] is Outcome.OK
    start = found.harmonics[0, :, 0].real.sum()
    path = solve_ivp(
        lambda t, z: 0.4 * np.cos(t) - z - beta * z**3, (0, 2 * np.pi), [start], method="DOP853", rtol=1e-12, atol=1e-14
    )
    assert path.y[0, -1] == pytest.approx(start, abs=1e-9)
