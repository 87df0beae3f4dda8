"""What a grid coupled in two dimensions does under a written waveform, by an integrator of its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["felt_after"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def felt_after(path: Path, *, until_s: float, window_s: float = 0.1) -> Complexes:
    """First harmonics of all actuators in the `window_s` before `until_s`, over full scale, shape (rows, cols).

    Reads the NPZ of samples at `path` and the manifest beside it: the file's own words, by no reader of dotwave.
    """
    manifest = json.loads(path.with_suffix(".json").read_text("utf-8"))
    device, rate = manifest["device"], manifest["rate_hz"]
    with np.load(path) as archive:
        volts = archive["volts"][: int(until_s * rate) + 1]
    shape, step = (device["rows"], device["cols"]), 2 * np.pi * device["f0_hz"] / rate
    force = np.zeros((len(volts), *shape))
    for channel in manifest["channels"]:
        force[:, channel["row"], channel.get("col", 0)] = volts[:, channel["index"]] * device["epsilon_per_volt"]
    right, down = _links(manifest["coupling"], shape, np.arange(len(volts)) / rate)
    z = _motion(force, right, down, step, device["delta"], device["beta"])
    tau = np.arange(len(volts))[-int(window_s * rate) :] * step
    frame = next(one for one in manifest["frames"] if one["end_s"] >= until_s)
    angle = frame["omega"][0] * tau
    basis = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    cosine, sine = np.linalg.lstsq(basis, z[-len(tau) :].reshape(len(tau), -1))[0]
    return np.asarray((cosine + 1j * sine).reshape(shape) / device["full_scale"])


def _motion(force: Floats, right: Floats, down: Floats, step: float, delta: float, beta: float) -> Floats:
    """Displacements at every sample, from rest: Runge and Kutta's fourth order, all straight between samples."""

    def slope(state: Floats, now: tuple[Floats, Floats, Floats]) -> Floats:
        z, v = state
        push = now[0] - delta * v - z - beta * z**3
        push[:, 1:] += now[1][:, 1:] * (z[:, :-1] - z[:, 1:])
        push[1:] += now[2][1:] * (z[:-1] - z[1:])
        return np.stack([v, push])

    z = np.zeros_like(force)
    state = np.zeros((2, *force.shape[1:]))
    for k in range(len(force) - 1):
        start, end = ((force[at], right[at], down[at]) for at in (k, k + 1))
        middle = tuple((one + other) / 2 for one, other in zip(start, end, strict=True))
        first = slope(state, start)
        second = slope(state + step / 2 * first, middle)
        third = slope(state + step / 2 * second, middle)
        fourth = slope(state + step * third, end)
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
        z[k + 1] = state[0]
    return z


def _links(events: list[dict[str, Any]], shape: tuple[int, int], times_s: Floats) -> tuple[Floats, Floats]:
    right, down = np.zeros((len(times_s), *shape)), np.zeros((len(times_s), *shape))
    for event in sorted(events, key=lambda one: one["t_s"]):
        for links, lam in ((right[:, event["row"], 1:], event["lam"]), (down[:, event["row"]], event["lam_y"])):
            start = int(np.searchsorted(times_s, event["t_s"] - 1e-9))
            if start >= len(times_s):
                continue
            before = links[start].copy()
            part = 1.0 if not event["ramp_s"] else np.clip((times_s[start:] - event["t_s"]) / event["ramp_s"], 0, 1)
            share = np.broadcast_to(part, (len(times_s) - start,))[:, None]
            links[start:] = before + share * (np.array(lam) - before)
    return right, down
