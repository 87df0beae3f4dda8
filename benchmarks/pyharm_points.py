"""pyHarm-os along a branch, run by its own interpreter: ``python pyharm_points.py`` with the question as JSON on stdin.

Reads n, delta, epsilon, lam, omega (from, to), points, step and a list of ways (harmonics, samples, solver and its
options, predictor, corrector); writes its version, and for each way seconds of the processor per point, whether all
were accepted, and the last point's omega and amplitudes of the first harmonic.
"""

import json
import logging
import sys
import time
from importlib.metadata import version
from typing import Any

import numpy as np
from pyHarm.Maestro import Maestro


def chain(asked: dict[str, Any], way: dict[str, Any]) -> dict[str, Any]:
    n, lam = asked["n"], asked["lam"]
    stiffness = np.eye(n) + lam * (np.diag([0.0] + [1.0] * (n - 1)) - np.eye(n, k=-1))
    matrices = {"M": np.eye(n), "C": asked["delta"] * np.eye(n), "K": stiffness}
    cubic = {f"cubic{m}": {"type": "CubicSpring", "connect": {"chain": [m]}, "dirs": [0], "k": -1.0} for m in range(n)}
    drive = {"type": "CosinusForcing", "connect": {"chain": [0]}, "dirs": [0], "amp": asked["epsilon"]}
    low, high = asked["omega"]
    return {
        "system": {"type": "Base", "nh": way["harmonics"], "nti": way["samples"]},
        "substructures": {"chain": {"matrix": matrices, "ndofs": 1}},
        "connectors": {**cubic, "drive": drive},
        "analysis": {
            "branch": {
                "study": "frf", "puls_inf": low, "puls_sup": high, "sign_ds": -1, "verbose": False,
                "solver": way["solver"], "solver_options": way["options"],
                "predictor": way["predictor"], "corrector": way["corrector"],
                "ds0": asked["step"], "ds_max": asked["step"], "ds_min": 1e-9,
            }
        },
    }  # fmt: skip


def measured(asked: dict[str, Any], way: dict[str, Any]) -> dict[str, Any]:
    maestro = Maestro(chain(asked, way))
    study = maestro.nls["branch"]
    study.initialise("null")
    warm, points = 10, asked["points"]
    for k in range(warm + points):
        if k == warm:
            began = time.process_time()
        study.makeStep(index_insolve=k + 1)
        study.purge_jacobians()
    seconds = (time.process_time() - began) / points
    taken = study.SolList[-points:]
    place = maestro.system.expl_dofs
    first = place[place["harm"] == 1]
    size = [float(np.hypot(*taken[-1].x[first[first["node_num"] == m].index])) for m in range(asked["n"])]
    return {
        "s_per_point": seconds, "accepted": bool(all(each.flag_accepted for each in taken)),
        "omega": float(taken[-1].x[-1]), "amplitude": size,
    }  # fmt: skip


def main() -> None:
    asked = json.load(sys.stdin)
    logging.disable(logging.CRITICAL)
    print(json.dumps([version("pyHarm-os"), [measured(asked, way) for way in asked["ways"]]]))


if __name__ == "__main__":
    main()
