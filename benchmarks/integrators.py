"""Peers that integrate: each as flows of many chains, at every choice of settings that has a chance to be its best.

A flow takes rows (see chain_rows), what is given, and a number of periods, and gives the rows at the end. What is
compiled for it is compiled before.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
from chain_rows import DELTA, STATES, VARIED, Floats, N, slope

__all__ = ["INTEGRATORS", "Flow", "Missing", "Way"]

Flow = Callable[[Floats, Floats, float], Floats]
HERE = Path(__file__).resolve().parent
TURN = 2 * np.pi
STEPPERS = ("runge_kutta_fehlberg78, controlled", "bulirsch_stoer")


class Missing(Exception):
    """A peer cannot be measured here, with the reason."""


@dataclass(frozen=True)
class Way:
    """One choice of settings.

    Attributes
    ----------
    settings : in words.
    lanes : chains that are integrated together.
    make : the flow at a tolerance, for a number of rows.
    """

    settings: str
    lanes: int
    make: Callable[[float, int], Flow]


def heyoka() -> Iterator[Way]:
    """Taylor series of many chains at once, code generated without compact mode."""
    try:
        import heyoka as hy
    except ImportError:
        raise Missing("heyoka is not installed: pip install heyoka") from None
    for lanes in (4, 8, 16):
        for fast in (False, True):

            def make(tolerance: float, rows: int, lanes: int = lanes, fast: bool = fast) -> Flow:
                made = hy.taylor_adaptive_batch(
                    _symbols(rows), np.zeros((rows, lanes)), tol=tolerance, pars=np.zeros((3, lanes)),
                    compact_mode=False, fast_math=fast,
                )  # fmt: skip

                def flow(y: Floats, given: Floats, periods: float) -> Floats:
                    made.set_time(0.0)
                    made.state[:], made.pars[:] = y, given
                    made.propagate_until(np.full(lanes, TURN * periods))
                    return np.array(made.state)

                return flow

            words = f"heyoka {version('heyoka')}, taylor_adaptive_batch, batch size {lanes}, compact_mode=False"
            yield Way(f"{words}, fast_math={fast}", lanes, make)


@cache
def _symbols(rows: int) -> list[tuple[object, object]]:
    """The equations of chain_rows for heyoka."""
    import heyoka as hy

    epsilon, lam, rate = hy.par[0], hy.par[1], hy.par[2]
    z, v = hy.make_vars(*[f"z{m}" for m in range(N)]), hy.make_vars(*[f"v{m}" for m in range(N)])
    system = []
    for m in range(N):
        push = lam * (z[m - 1] - z[m]) if m else epsilon * hy.cos(hy.time)
        # A power would be no number at rest.
        system += [(z[m], rate * v[m]), (v[m], rate * (push - DELTA * v[m] - z[m] + z[m] * z[m] * z[m]))]
    for j, k in ((j, k) for j in range(N) for k in range(2) if rows == VARIED):
        before = None
        for m in range(j, N):
            u, w = hy.make_vars(f"u{m}_{j}_{k}", f"w{m}_{j}_{k}")
            force = 3.0 * (z[m] * z[m]) * u - u - DELTA * w
            force = force if m == 0 else force - lam * u
            force = force if before is None else force + lam * before
            system += [(u, rate * w), (w, rate * force)]
            before = u
    return system


def scipy() -> Iterator[Way]:
    """The compiled DOP853 behind scipy.integrate.ode, many chains as one system, a right side compiled by numba."""
    from scipy.integrate import ode

    for lanes in (64, 256):

        def make(tolerance: float, rows: int, lanes: int = lanes) -> Flow:
            def flow(y: Floats, given: Floats, periods: float) -> Floats:
                def right(phase: float, flat: Floats) -> Floats:
                    out = np.empty((rows, lanes))
                    slope(phase, flat.reshape(rows, lanes), out, given)
                    return out.ravel()

                made = ode(right).set_integrator("dop853", rtol=tolerance, atol=tolerance / 100, nsteps=10**8)
                made.set_initial_value(y.ravel(), 0.0)
                return np.array(made.integrate(TURN * periods)).reshape(rows, lanes)

            return flow

        words = f"SciPy {version('scipy')}, integrate.ode('dop853'), right side by numba with fastmath"
        yield Way(f"{words}, {lanes} chains as one system", lanes, make)


def numbalsoda() -> Iterator[Way]:
    """Its dop853 in Fortran behind a compiled right side, many chains as one system."""
    try:
        import numba as nb
        from numba.np.numpy_support import carray
        from numbalsoda import dop853, lsoda_sig
    except ImportError:
        raise Missing("numbalsoda is not installed: pip install numbalsoda (needs gfortran and cmake)") from None
    # It stops after 10,000 steps of one call.
    hop = 30

    @cache
    def right(rows: int, lanes: int) -> object:
        @nb.cfunc(lsoda_sig, fastmath=True)
        def made(phase, y_, out_, given_):  # type: ignore[no-untyped-def]
            y, out = carray(y_, (rows, lanes)), carray(out_, (rows, lanes))
            slope(phase, y, out, carray(given_, (3, lanes)))

        return made

    for lanes in (8, 16, 64):

        def make(tolerance: float, rows: int, lanes: int = lanes) -> Flow:
            address = right(rows, lanes).address  # type: ignore[attr-defined]

            def flow(y: Floats, given: Floats, periods: float) -> Floats:
                flat, data = y.ravel(), given.ravel()
                for first in np.arange(0, periods, hop):
                    span = TURN * np.array([first, min(first + hop, periods)])
                    found, good = dop853(address, flat, span, data=data, rtol=tolerance, atol=tolerance / 100)
                    assert good
                    flat = found[-1]
                return np.array(flat).reshape(rows, lanes)

            return flow

        words = f"numbalsoda {version('numbalsoda')}, dop853, right side by numba with fastmath"
        yield Way(f"{words}, {lanes} chains as one system", lanes, make)


def odeint() -> Iterator[Way]:
    """Boost.odeint, compiled here, chains side by side in vectors."""
    compiler, header = shutil.which("g++"), Path("/usr/include/boost/version.hpp")
    if compiler is None or not (header.parent / "numeric" / "odeint.hpp").exists():
        raise Missing("needs g++ and Boost.odeint: apt-get install g++ libboost-dev")
    lines = header.read_text(encoding="utf-8").splitlines()
    number = next(line.split('"')[1] for line in lines if "define BOOST_LIB_VERSION" in line)
    flags = ["-O3", "-march=native", "-ffast-math", "-std=c++17"]
    for lanes, stepper in ((8, 0), (8, 1), (16, 1)):
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / "flow.so"
            build = [compiler, *flags, "-shared", "-fPIC", f"-DLANES={lanes}", f"-DSTEPPER={stepper}"]
            call = [*build, str(HERE / "odeint.cpp"), "-o", str(made)]
            done = subprocess.run(call, check=False, capture_output=True, text=True)
            if done.returncode:
                raise Missing(f"g++ failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
            library = ctypes.CDLL(str(made))

        def make(tolerance: float, rows: int, library: ctypes.CDLL = library) -> Flow:
            call = library.flow_states if rows == STATES else library.flow_varied
            call.argtypes = [ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_double] * 3]

            def flow(y: Floats, given: Floats, periods: float) -> Floats:
                end, given = np.array(y, order="C"), np.ascontiguousarray(given)
                call(end.ctypes.data, given.ctypes.data, DELTA, periods, tolerance)
                return end

            return flow

        words = f"Boost {number}, odeint, {STEPPERS[stepper]}, g++ {' '.join(flags)}"
        yield Way(f"{words}, {lanes} chains as one system", lanes, make)


INTEGRATORS: dict[str, Callable[[], Iterator[Way]]] = {
    "SciPy": scipy, "heyoka": heyoka, "numbalsoda": numbalsoda, "Boost.odeint": odeint,
}  # fmt: skip
