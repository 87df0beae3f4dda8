"""Frames put on the sample grid, one by one, after a check that they fit each other and the device."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from planner import FramePlan, OperatingPoint, Ramp

from ..errors import WaveformError

__all__ = ["PlacedFrame", "stretches"]


@dataclass(frozen=True)
class PlacedFrame:
    """A frame and its samples `first` to `stop` (excluded), counted from the start of the waveform."""

    plan: FramePlan
    first: int
    stop: int


def stretches(device: Device, frames: Iterable[FramePlan]) -> Iterator[PlacedFrame]:
    """Check `frames` and place them at round(start_s * rate), lazily.

    Raises
    ------
    WaveformError
        When a frame does not join the one before it, or does not fit the device; the message names the
        frame (from 0), the row and the field.
    """
    rate, joint = device.amplifier.rate_hz, 0
    for number, frame in enumerate(frames):
        place = f"frame {number}"
        _check_times(place, frame)
        first, stop = round(frame.start_s * rate), round(frame.end_s * rate)
        if first != joint:
            raise WaveformError(
                f"{place}: starts at {frame.start_s} s where {joint / rate} s is wanted; "
                "the first frame starts at 0 and each next one where the last ends"
            )
        _check_chains(place, device, frame)
        yield PlacedFrame(frame, first, stop)
        joint = stop


def _check_times(place: str, frame: FramePlan) -> None:
    times = (frame.start_s, frame.settled_s, frame.end_s)
    if not (np.all(np.isfinite(times)) and 0 <= times[0] <= times[1] <= times[2]):
        raise WaveformError(
            f"{place}: start_s {times[0]}, settled_s {times[1]}, end_s {times[2]} are not finite times in that order"
        )


def _check_chains(place: str, device: Device, frame: FramePlan) -> None:
    wanted = device.chains
    if (len(frame.states), len(frame.ramps)) != (wanted, wanted):
        raise WaveformError(
            f"{place}: {len(frame.states)} states and {len(frame.ramps)} ramps for the {wanted} chains of {device.name}"
        )
    # A ramp may end half a sample after its frame, because frames end on a sample.
    longest = frame.end_s - frame.start_s + 0.5 / device.amplifier.rate_hz
    checked: set[int] = set()
    for index, (state, ramp) in enumerate(zip(frame.states, frame.ramps, strict=True)):
        row, chain = divmod(index, device.chains_per_row)
        where = f"{place}, row {row}" + (f", chain {chain}" if device.chains_per_row > 1 else "")
        # Equal rows share their objects.
        if id(state) not in checked:
            _check_state(where, device, state)
        if ramp is not None and id(ramp) not in checked:
            _check_ramp(where, device, ramp, longest)
        checked.update((id(state), id(ramp)))


def _check_state(where: str, device: Device, state: OperatingPoint) -> None:
    n = device.chain_length
    _check_array(f"{where}: target", state.target, (n,))
    _check_array(f"{where}: bias", state.bias, (n,))
    _check_array(f"{where}: lam", state.lam, (device.links,))
    if device.bias == "none" and np.any(state.bias):
        raise WaveformError(f"{where}: a bias of {state.bias[np.flatnonzero(state.bias)[0]]}, but {_no_bias(device)}")
    for omega in (state.omega, *(tone.omega for tone in state.tones)):
        _check_omega(where, device, omega)


def _check_omega(where: str, device: Device, omega: float) -> None:
    if not (np.isfinite(omega) and omega > 0):
        raise WaveformError(f"{where}: omega: expected a finite number > 0, got {omega}")
    hertz = omega * device.f0_hz
    if 2 * hertz >= device.amplifier.rate_hz:
        raise WaveformError(
            f"{where}: a drive at {hertz:.6g} Hz needs more than {2 * hertz:.6g} samples a second, the amplifier of "
            f"{device.name} takes {device.amplifier.rate_hz}; raise amplifier.rate_hz"
        )


def _check_ramp(where: str, device: Device, ramp: Ramp, longest: float) -> None:
    n = device.chain_length
    _check_nodes(f"{where}: ramp.t_s", ramp.t_s, longest)
    for name, array, shape in (
        ("epsilon", ramp.epsilon, ramp.t_s.shape),
        ("epsilon_slope", ramp.epsilon_slope, ramp.t_s.shape),
        ("bias", ramp.bias, (len(ramp.t_s), n)),
        ("bias_slope", ramp.bias_slope, (len(ramp.t_s), n)),
    ):
        if array is not None:
            _check_array(f"{where}: ramp.{name}", array, shape)
    for tone in ramp.tones:
        _check_omega(f"{where}: ramp.tones", device, tone.omega)
        _check_array(f"{where}: ramp.tones.epsilon", tone.epsilon, ramp.t_s.shape)
        if tone.epsilon_slope is not None:
            _check_array(f"{where}: ramp.tones.epsilon_slope", tone.epsilon_slope, ramp.t_s.shape)
    if ramp.bias is not None and device.bias == "none":
        raise WaveformError(f"{where}: ramp.bias is given, but {_no_bias(device)}")
    if (ramp.lam is None) != (ramp.lam_t_s is None):
        raise WaveformError(f"{where}: ramp.lam and ramp.lam_t_s: give both or neither")
    if ramp.lam is not None and ramp.lam_t_s is not None:
        _check_nodes(f"{where}: ramp.lam_t_s", ramp.lam_t_s, longest)
        _check_array(f"{where}: ramp.lam", ramp.lam, (len(ramp.lam_t_s), device.links))


def _no_bias(device: Device) -> str:
    return f"{device.name} has no bias channels; plan for a device with bias: actuator"


def _check_nodes(where: str, times: NDArray[np.float64], longest: float) -> None:
    _check_array(where, times, (max(1, times.size),))
    if times[0] < 0 or np.any(np.diff(times) < 0):
        raise WaveformError(f"{where}: expected times from 0 upwards, got {times[0]} .. {times[-1]}")
    if times[-1] > longest:
        raise WaveformError(f"{where}: a ramp of {times[-1]} s in a frame of {longest:.6g} s; show the frame longer")


def _check_array(where: str, array: NDArray[np.float64] | NDArray[np.complex128], shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise WaveformError(f"{where}: expected shape {shape}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise WaveformError(f"{where}: expected finite numbers, got {array[~np.isfinite(array)].flat[0]}")
