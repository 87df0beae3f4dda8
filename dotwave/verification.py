"""What a written waveform makes felt: the full equations integrated under the samples in the file."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import AsBuilt, Device
from drivers import FrameMark, Manifest, Role, read_waveform
from encoders import (
    FeltPage,
    Presentation,
    back_check,
    covered_emphases,
    covered_text,
    emphases_of,
    emphases_within,
    read_page,
)

from .beating import RowEnvelope
from .progress import progress
from .reports.text import FrameCheck, VerifyReport
from .swelling import Swelling

if TYPE_CHECKING:
    from .passing import PassingFit

__all__ = ["forces_under", "frequencies", "verify"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Forces, links and positions of a block stay near 8 MB each, whatever the grid.
BLOCK_VALUES = 1 << 20


class _Felt(NamedTuple):
    """What one frame makes felt, in units of full scale: float64, shape (rows, cols) each.

    `level` is what is compared with wish and target: the mean of a bias pattern, else the amplitude at the drive's
    frequency, or the sum of those at all its tones; of a modulated carrier what is felt of how it swells; where nothing
    is to move without a bias, the amplitude of all that does.
    `still` and `moving` are both of them. `error` is the deviation from the target: of the complex amplitude where
    phases are wanted, of the worst tone where there are several. `way` is the largest deviation from the way of what
    travels, else None.
    """

    level: Floats
    still: Floats
    moving: Floats
    error: Floats
    way: float | None = None


def verify(path: Path, icon: str | None = None) -> VerifyReport:
    """Integrate the device's full equations under the samples of `path` and say what is felt.

    Actuators that were measured are what they were measured to be.

    Reads the samples and the manifest beside them, nothing else; of a pack the one entry `icon`.

    Raises
    ------
    FileError, UnreadableWaveform
        When the files cannot be used, or the samples are not those the manifest was written for.
    """
    began = time.perf_counter()
    manifest, reader = read_waveform(path, icon)
    manifest.check_digest(reader.path)
    integration = _Integration(manifest)
    with progress("verifying") as update:
        for block in reader.blocks(integration.block):
            integration.advance(block)
            update(integration.position, manifest.samples)
    checks = [_check(mark, felt) for mark, felt in zip(manifest.frames, integration.felt(), strict=True)]
    report = VerifyReport(
        path=str(reader.path),
        device=manifest.device.name,
        frames=tuple(checks),
        samples=manifest.samples,
        rate_hz=manifest.rate_hz,
        notes=tuple(integration.notes()),
    )
    if manifest.encoding.get("kind") in {"text", "braille"}:
        report = _with_text(report, manifest)
    return replace(report, seconds=time.perf_counter() - began)


class _Integration:
    """The grid under the samples, and what each frame collects of its motion while it stands."""

    def __init__(self, manifest: Manifest) -> None:
        device = manifest.device
        self._manifest, self._device = manifest, device
        self.block = max(256, BLOCK_VALUES // (device.rows * device.cols))
        self._built = AsBuilt(device)
        self._grid = self._built.integrator(manifest.rate_hz)
        self._fits = [
            _Fit(device, mark, manifest.rate_hz, _passing(manifest, number))
            for number, mark in enumerate(manifest.frames)
        ]
        self._first = 0
        self.position = 0

    def advance(self, volts: Floats) -> None:
        """Take the next block of samples, float64, shape (S, channels), volts."""
        manifest = self._manifest
        index = np.arange(self.position, self.position + len(volts))
        force = forces_under(volts, manifest, self._built)
        times_s = index / manifest.rate_hz
        lam = manifest.lam_at(times_s) * self._built.lam_gain
        z = self._grid.advance(force, lam, manifest.lam_y_at(times_s))
        for fit in self._fits[self._first :]:
            if fit.begin > index[-1]:
                break
            fit.take(index, z)
        while self._first < len(self._fits) and self._fits[self._first].stop <= index[-1] + 1:
            self._first += 1
        self.position += len(volts)

    def felt(self) -> Iterator[_Felt]:
        """What each frame makes felt."""
        for fit in self._fits:
            yield fit.felt()

    def notes(self) -> Iterator[str]:
        """What a person should know of the integration."""
        gone = self._grid.escaped
        if gone is not None:
            yield (
                f"The actuator in row {gone.row}, column {gone.col} left its softening well at "
                f"{gone.sample / self._manifest.rate_hz:.3f} s; its chain counts as not felt from there on."
            )


def _passing(manifest: Manifest, number: int) -> PassingFit | None:
    """What looks at the way of a frame that travels; None for one that does not, or has none before it."""
    mark = manifest.frames[number]
    if not mark.smoothness or not number:
        return None
    from .passing import PassingFit

    return PassingFit(manifest.device, manifest.frames[number - 1], mark, manifest.rate_hz)


def forces_under(volts: Floats, manifest: Manifest, built: AsBuilt) -> Floats:
    """Dimensionless force on every actuator under a block of samples.

    Parameters
    ----------
    volts : float64, shape (S, channels).

    Returns
    -------
    float64, shape (S, rows, cols).
    """
    device = manifest.device
    force = np.zeros((len(volts), device.rows, device.cols))
    for channel in manifest.channels:
        row, col = channel.row, channel.col or 0
        driven = channel.role is Role.DRIVE
        per_volt = built.drive_per_volt[row, col] if driven else device.bias_per_volt
        force[:, row, col] += volts[:, channel.index] * per_volt
    return force


class _Fit:
    """Least squares of 1 and of cos and sin at each row's frequencies over the samples of one frame."""

    def __init__(self, device: Device, mark: FrameMark, rate_hz: int, passing: PassingFit | None) -> None:
        self._device, self._mark, self._rate_hz, self._passing = device, mark, rate_hz, passing
        self.first = round(mark.settled_s * rate_hz)
        self.begin = self.first if passing is None else round(mark.start_s * rate_hz)
        self.stop = round(mark.end_s * rate_hz)
        self._rates = [frequencies(omega, tones) for omega, tones in zip(mark.omega, mark.tones, strict=True)]
        sizes = [1 + 2 * len(rates) for rates in self._rates]
        self._gram = [np.zeros((size, size)) for size in sizes]
        self._load = [np.zeros((size, device.cols)) for size in sizes]
        self._squares = np.zeros((device.rows, device.cols))
        self._envelopes = {
            row: RowEnvelope(float(mark.omega[row]) * device.tau_per_s, (self.stop - self.first) / rate_hz, device.cols)
            for row, beats in enumerate(mark.beats) if beats is not None
        }  # fmt: skip
        self._modulated = np.array(mark.modulated)
        self._swelling = Swelling(device, rate_hz) if any(mark.modulated) else None

    def take(self, index: NDArray[np.intp], z: Floats) -> None:
        """Collect the samples of a block that belong to the frame."""
        if self._passing is not None:
            self._passing.take(index, z)
        inside = slice(*np.searchsorted(index, [self.first, self.stop]))
        tau = index[inside] / self._rate_hz * self._device.tau_per_s
        for row, envelope in self._envelopes.items():
            envelope.take(index[inside] / self._rate_hz - self.first / self._rate_hz, z[inside, row])
        if self._swelling is not None:
            self._swelling.take(index[inside], z[inside])
        for row, rates in enumerate(self._rates):
            if row == 0 or rates != self._rates[row - 1]:
                waves = (wave(rate * tau) for rate in rates for wave in (np.cos, np.sin))
                basis = np.stack([np.ones_like(tau), *waves])
            self._gram[row] += basis @ basis.T
            self._load[row] += basis @ z[inside, row]
            if not rates:
                self._squares[row] += (z[inside, row] ** 2).sum(axis=0)

    def felt(self) -> _Felt:
        """What is felt; NaN where the frame has too few samples to tell."""
        full, shape, mark = self._device.full_scale, (self._device.rows, self._device.cols), self._mark
        if self._gram[0][0, 0] < max(map(len, self._gram)):
            nothing = np.full(shape, np.nan)
            return _Felt(nothing, nothing, nothing, nothing)
        still, phasor, moving = np.zeros(shape), np.zeros(shape, dtype=np.complex128), np.zeros(shape)
        worst = np.zeros(shape)
        for row, (gram, load) in enumerate(zip(self._gram, self._load, strict=True)):
            parts = np.linalg.lstsq(gram, load)[0] / full
            still[row] = parts[0]
            if not mark.omega[row]:
                # At no frequency: all that moves is too much.
                moving[row] = np.sqrt(2 * np.maximum(self._squares[row] / gram[0, 0] / full**2 - still[row] ** 2, 0.0))
                continue
            count = 1 + len(mark.tones[row])
            tones = parts[1 : 1 + 2 * count : 2] - 1j * parts[2 : 2 + 2 * count : 2]
            phasor[row], moving[row] = tones[0], np.abs(tones).sum(axis=0)
            worst[row] = np.abs(count * np.abs(tones) - mark.target[row]).max(axis=0)
        standing = ~np.array(mark.moving)
        # Without a bias nothing but a motion can be felt of a row that is to stand still.
        level = np.where((standing & (self._device.bias == "actuator"))[:, np.newaxis], still, moving)
        worst[standing] = np.abs(level - mark.target)[standing]
        for row, envelope in self._envelopes.items():
            level[row], worst[row] = envelope.judged(mark.target[row] * full, mark.beats[row] or (0.0, 1.0), full)
        if self._swelling is not None:
            self._swelled(level, worst, moving)
        way = None if self._passing is None else self._passing.error()
        return _Felt(level, still, moving, np.maximum(worst, self._out_of_phase(phasor)), way)

    def _swelled(self, level: Floats, worst: Floats, moving: Floats) -> None:
        """Of rows whose carriers are not felt, put in what is."""
        assert self._swelling is not None
        rows, felt = self._modulated, self._swelling.felt()
        level[rows] = moving[rows] = felt[rows]
        worst[rows] = np.abs(felt - self._mark.target)[rows]

    def _out_of_phase(self, phasor: Complexes) -> Floats:
        """Deviation from the wanted phasors, 0 where any phase will do; rows of one omega are turned alike."""
        mark = self._mark
        wanted = mark.target * np.exp(1j * np.nan_to_num(mark.phase)) * ~np.isnan(mark.phase)
        away = np.zeros(phasor.shape)
        for omega in set(mark.omega.tolist()):
            rows = mark.omega == omega
            turn = np.exp(1j * np.angle(np.vdot(phasor[rows], wanted[rows])))
            away[rows] = np.abs(phasor[rows] * turn - wanted[rows])
        return np.where(np.isnan(mark.phase), 0.0, away)


def frequencies(omega: float, tones: tuple[float, ...]) -> list[float]:
    """The tones of a row, then the combinations that a cubic spring makes of them beside each; none where it rests."""
    own = [float(omega), *tones] if omega else []
    return own + sorted({2 * one - other for one in own for other in own} - set(own))


def _check(mark: FrameMark, felt: _Felt) -> FrameCheck:
    verdict = mark.wish.verdict(felt.level)
    return FrameCheck(
        page=mark.page,
        start_s=mark.start_s,
        settled_s=mark.settled_s,
        end_s=mark.end_s,
        outcome=str(mark.outcome),
        target=mark.target,
        wish=mark.wish,
        felt=felt.level,
        wrong_dots=int(verdict.wrong_dots),
        contrast_db=None if verdict.contrast_db is None else float(verdict.contrast_db),
        amplitude_error=max(float(np.max(felt.error)), felt.way or 0.0),
        way_error=felt.way,
        wanted_cells=mark.cells,
        text=mark.text,
    )


def _with_text(report: VerifyReport, manifest: Manifest) -> VerifyReport:
    """Read the felt dots of each page as cells, and translate them back."""
    encoding = manifest.encoding
    emphases, scrolls = emphases_of(encoding), encoding.get("presentation") == Presentation.SCROLL
    checks: list[FrameCheck] = []
    pages: list[FeltPage] = []
    marks = {mark.page: mark for mark in manifest.frames}
    for number, parts in groupby(report.frames, key=lambda check: check.page):
        together = list(parts)
        dots = [check.felt_dots for check in together if not scrolls or check.way_error is not None]
        cells = read_page(dots, encoding)
        mark = marks[number]
        pages.append(FeltPage(cells, mark.text, mark.goes_on, emphases_within(emphases, *mark.span), mark.number))
        checks += [replace(check, felt_cells=cells) for check in together]
    shown = [(mark.span, mark.text) for mark in manifest.frames]
    source = covered_text(shown)
    check = back_check(pages, source, encoding, covered_emphases(shown, emphases))
    return replace(
        report,
        frames=tuple(checks),
        source_text=source,
        felt_text=check.back,
        text_equal=check.text_equal,
        cells_equal=check.cells_equal,
        differences=tuple(one.sentence for one in (*check.differences, *check.alone)),
        notes=(*report.notes, check.sentence),
    )
