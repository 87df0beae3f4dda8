"""One way in to every solver: a rung by name, or the cheapest whose error estimate meets the tolerance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..equations.basis import basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..harmonic_balance.answer import Answer, response_of, stitch
from ..harmonic_balance.long import LONG, low_alone
from ..harmonic_balance.rung import balance_near
from ..model.response import Outcome, Response, Stats
from ..rung import MAX_PERIODS, RungError, Start, load_rung
from .beside import beside
from .rest import sure_from_rest

if TYPE_CHECKING:
    from ..harmonic_balance.joint_branches import Branches

__all__ = ["every_branch", "lists_jointly", "solve"]

# Distance, relative to each oscillator, at which the answer of harmonic balance is the orbit that was integrated (known
# to 1e-5). Two orbits may differ in the far end of a chain alone; FAINT of the largest oscillator nothing is seen.
SAME_ORBIT = 1e-2
FAINT = 1e-8
# Of the hilltop, for a mean: a sudden force swings to twice as far and more, and at 0.2955 it throws it over.
THROWN = 0.25


def solve(
    chain: Chain, setting: Setting, *, tol: float, rung: str = "auto", start: str | ArrayLike = "rest"
) -> Response:
    """Periodic steady states of N settings.

    Parameters
    ----------
    tol : wanted accuracy of amplitudes, relative to each setting's largest; from 1e-12 up to 1.
    rung : a name in `RUNGS`, or ``auto``: the cheapest rung whose error estimate meets `tol`.
    start : ``rest``, a sudden drive from z = z' = 0. ``auto`` says which answer is reached and whether the motion
        escapes or does not lock, integrating where that is not plain; a steady rung by name gives the lower branch.
        ``ramp``, the drive raised slowly from 0: the lower branch; past its fold, where ``auto`` and ``ode`` find
        that a drive raised within 100/delta ends (other rungs: `NO_CONVERGENCE`).
        ``all``, every branch of one setting, along the batch axis, the lowest first. Of a ring or a bidirectional chain
        `joint_branches` also says whether the list is complete.
        Amplitudes, complex128, shape (N, n), for ``auto``: the motion has a way in of its own that ends there (first
        harmonics, or deflections where nothing is driven). The answer is the stable one beside it; what a sudden drive
        would reach is not asked, and nothing is integrated.

    Raises
    ------
    ValueError
        When `tol` or `start` is none of these.
    RungError
        When the rung cannot answer the question; also a ValueError.
    """
    if not (math.isfinite(tol) and 1e-12 <= tol <= 1):
        raise ValueError(f"tol: expected a number from 1e-12 to 1, got {tol}")
    if isinstance(start, str) and start not in set(Start):
        raise ValueError(f"start: expected one of {', '.join(Start)}, got {start!r}")
    if len(setting) == 0:
        raise ValueError("setting: expected at least one setting, got none")
    if setting.n != chain.n:
        raise ValueError(f"setting: made for {setting.n} oscillators, the chain has {chain.n}")
    if not isinstance(start, str):
        if rung != "auto":
            raise RungError(f"rung {rung}: it does not start from amplitudes; use rung auto, or start rest or ramp")
        return beside(chain, setting, np.asarray(start, dtype=np.complex128), tol=tol)
    way = Start(start)
    if way is Start.ALL and lists_jointly(chain, rung):
        return every_branch(chain, setting, tol=tol, rung=rung).response
    if rung != "auto":
        return load_rung(rung).solve(chain, setting, tol=tol, start=way)
    if not chain.betas.any():
        return _linear(chain, setting, tol, way)
    if way is Start.ALL:
        return load_rung(_listing(setting)).solve(chain, setting, tol=tol, start=way)
    steady = _cheapest(chain, setting, tol, way)
    if way is Start.REST:
        return _from_rest(chain, setting, tol, steady)
    from .ramp import from_ramp

    return from_ramp(chain, setting, steady, tol=tol, max_periods=MAX_PERIODS)


def lists_jointly(chain: Chain, rung: str) -> bool:
    """Whether `every_branch` answers start all: a rung, or auto, that lists the branches of all oscillators at once."""
    joint = bool(chain.betas.any()) and not chain.feed_forward
    return joint and (rung == "auto" or load_rung(rung).lists_branches)


def every_branch(chain: Chain, setting: Setting, *, tol: float, rung: str) -> Branches:
    """`joint_branches` by a rung, or by the one that ``auto`` takes.

    Raises
    ------
    RungError
        As `joint_branches`.
    """
    from ..harmonic_balance.joint_branches import joint_branches

    return joint_branches(chain, setting, tol=tol, rung=rung if rung != "auto" else _listing(setting))


def _listing(setting: Setting) -> str:
    """The rung by which ``auto`` lists every branch."""
    return "harmonic_balance" if setting.epsilon.any() else "static"


def _linear(chain: Chain, setting: Setting, tol: float, start: Start) -> Response:
    response = load_rung("linear").solve(chain, setting, tol=tol, start=start)
    if chain.deltas.all() or start is not Start.REST:
        return response
    outcome = response.outcome.copy()
    # Without damping the start-up transient never dies out.
    outcome[outcome == Outcome.UNSTABLE] = Outcome.NOT_LOCKED
    outcome.flags.writeable = False
    return replace(response, outcome=outcome, locked=response.locked & (outcome != Outcome.NOT_LOCKED))


def _cheapest(chain: Chain, setting: Setting, tol: float, start: Start) -> Response:
    """The answer of the cheapest rung whose every estimate meets `tol`."""
    work = Stats()
    for name in _candidates(chain, setting, tol):
        response = load_rung(name).solve(chain, setting, tol=tol, start=start)
        work = work + response.stats
        if bool((response.error_estimate <= tol).all()):
            break
    return replace(response, stats=work)


def _candidates(chain: Chain, setting: Setting, tol: float) -> tuple[str, ...]:
    """Rungs worth a try, cheapest first: the share of the cubic term at the first oscillator says which could do.

    The third harmonic, slaved to the first, is beta a^2/32 of it, and acts back by that much of the cubic term's share.
    """
    if not setting.epsilon.any():
        return ("static",)
    with np.errstate(all="ignore"):
        impedance = chain.stiffness[0] - setting.omega**2 + 1j * chain.deltas[0] * setting.omega
        square = np.abs(chain.betas).max() * np.abs(setting.epsilon / impedance) ** 2
        share = 0.75 * square / np.abs(impedance)
        hopeless = bool((share * square / 32 > 10 * tol).any())
    if bool((share <= tol).all()):
        return ("linear", "one_harmonic", "harmonic_balance")
    return ("harmonic_balance",) if hopeless else ("one_harmonic", "harmonic_balance")


def _from_rest(chain: Chain, setting: Setting, tol: float, steady: Response) -> Response:
    """`steady` where it is surely reached from rest, and what an integration says elsewhere."""
    sure = _sure(chain, setting, steady) & (steady.outcome == Outcome.OK)
    if sure.all():
        return steady
    if chain.n > LONG:
        # An integration of it is beyond any budget.
        outcome = np.where(sure, steady.outcome, np.array(Outcome.OUT_OF_BUDGET, dtype=object))
        return replace(steady, outcome=outcome)
    asked = np.flatnonzero(~sure)
    parts = [(asked[index], part) for index, part in _integrated(chain, setting[asked], tol)]
    if sure.any():
        parts.append((np.flatnonzero(sure), _subset(steady, sure)))
    names = {part.rung for _, part in parts}
    whole = stitch("ode" if "ode" in names else steady.rung if len(names) > 1 else names.pop(), len(setting), parts)
    return replace(whole, stats=whole.stats + (steady.stats if not sure.any() else Stats()))


def _sure(chain: Chain, setting: Setting, steady: Response) -> NDArray[np.bool_]:
    """`sure_from_rest`, and for a long chain a bound whose cost is in proportion to its length."""
    if chain.n <= LONG:
        return sure_from_rest(chain, setting, steady) & _held(chain, setting, steady)
    sure = np.zeros(len(setting), dtype=bool)
    if not chain.law.in_line or setting.preload.any() or setting.bias.any():
        return sure
    for index in np.flatnonzero(steady.stable):
        scaled = ScaledChain.of(chain, setting[index : index + 1])
        with np.errstate(all="ignore"):
            sure[index] = low_alone(scaled, steady.phasor[index] * scaled.length)
    return sure


def _held(chain: Chain, setting: Setting, steady: Response) -> NDArray[np.bool_]:
    """Whether constant forces that set in suddenly cannot throw an oscillator out of its well; bool, shape (N,)."""
    scaled = ScaledChain.of(chain, setting)
    top = np.sqrt(np.maximum(scaled.k, 0.0) / np.maximum(-scaled.sign, 1e-300))
    return np.asarray((np.abs(steady.mean.T) * scaled.length <= THROWN * top).all(axis=0))


def _integrated(chain: Chain, setting: Setting, tol: float) -> list[tuple[NDArray[np.intp], Response]]:
    """What is reached from rest: integrated until sure, then refined by harmonic balance beside that orbit."""
    from ..time_domain.ode import reached_from_rest, steady_from_rest

    reached = reached_from_rest(chain, setting, max_periods=MAX_PERIODS)
    ok = reached.outcome == Outcome.OK
    parts: list[tuple[NDArray[np.intp], Response]] = []
    if not ok.all():
        lost = np.flatnonzero(~ok)
        parts.append((lost, _unanswered(chain, setting[lost], reached.outcome[lost])))
    found = np.flatnonzero(ok)
    if len(found):
        phasor = reached.phasor[found]
        near = balance_near(chain, setting[found], phasor, tol=tol)
        with np.errstate(invalid="ignore"):
            size = np.abs(phasor)
            size = np.maximum(size, FAINT * size.max(axis=1, keepdims=True))
            # Without a drive first harmonics tell nothing.
            same = (np.abs(near.phasor - phasor) <= SAME_ORBIT * size).all(axis=1) & (size > 0).all(axis=1)
        good = (near.outcome == Outcome.OK) & same
        if good.any():
            parts.append((found[good], _subset(near, good)))
        if not good.all():
            rest = found[~good]
            parts.append((rest, steady_from_rest(chain, setting[rest], tol=tol, max_periods=MAX_PERIODS)))
    first, part = parts[0]
    parts[0] = (first, replace(part, stats=part.stats + reached.stats))
    return parts


def _unanswered(chain: Chain, setting: Setting, outcome: NDArray[np.object_]) -> Response:
    scaled = ScaledChain.of(chain, setting)
    basis = basis_for(1, False)
    nothing = np.full((scaled.n, basis.size, len(scaled)), np.nan)
    unknown = np.full((len(scaled), scaled.n, 2), np.nan, dtype=np.complex128)
    branch = np.zeros((scaled.n, len(scaled)), dtype=np.int8)
    estimate = np.full(len(scaled), np.inf)
    answer = Answer(basis, nothing, outcome, branch, estimate, unknown)
    silent = response_of(scaled, "ode", answer, Stats(), 0.0)
    return replace(silent, stats=Stats())


def _subset(response: Response, index: NDArray[np.bool_]) -> Response:
    return replace(
        response,
        outcome=response.outcome[index], harmonics=response.harmonics[index], mean=response.mean[index],
        stable=response.stable[index], locked=response.locked[index], multipliers=response.multipliers[index],
        branch=response.branch[index], error_estimate=response.error_estimate[index],
    )  # fmt: skip
