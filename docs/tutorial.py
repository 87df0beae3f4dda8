# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # From a word to what a finger feels
#
# `dotwave` turns words into Braille on a grid of small piezoelectric actuators, which are coupled to chains: a few
# amplifiers drive many dots. This page goes the whole way once, in about ten lines of Python. Every figure is followed
# by the same as text.
#
# `./run notebook` opens it in Jupyter. It is kept as a script, `docs/tutorial.py`, and the tests run it.

# %%
import numpy as np

import dotwave as dw

# %% [markdown]
# ## A device and a text
#
# A device is the hardware as built. `linked-6x6` has six rows of six actuators. Each row is one chain, with one
# amplifier at its first actuator and a coupling, `lam`, that can be set on every link.

# %%
device = dw.device("linked-6x6")
scene = dw.text("Hello world", device)
for frame in scene.frames:
    print(f"{frame.text!r} is shown for {frame.dwell_s:g} s as {' / '.join(frame.cells.splitlines())}")

# %% [markdown]
# ## A plan
#
# A plan has the settings that make every frame: the drive, its frequency and the couplings of every chain, and the way
# from one frame to the next. It is a sequence, and nothing is planned before it is asked for. With `tol` a frame that
# is off by more than so much of full scale would be called `unreachable`.

# %%
plan = dw.plan(scene, device, tol=0.02)
print(f"{len(plan)} frames; the first: {plan[0].outcome}, predicted error {100 * plan[0].error:.2g} % of full scale")
chain = plan[0].states[0]
print(f"Its first row is driven at {chain.omega * device.f0_hz:.1f} Hz, with these couplings:")
print(np.array2string(chain.lam, precision=4))

# %%
plan  # noqa: B018 - a notebook shows it as a table

# %% [markdown]
# Not every term of the model matters to every scene. `explain` lists what this one needs, with an estimate of what each
# term would do.

# %%
print(plan.explain(tol=1e-2).as_text())

# %% [markdown]
# ## A waveform
#
# The voltages are sampled when they are asked for. Channel 0 is the drive of the first row. It rises along a smooth
# way, and from then on the pattern stands.

# %%
wave = plan.waveform()
volts = wave.samples(0.0, 0.5)
print(f"{volts.shape[0]} samples of {volts.shape[1]} channels; largest {np.abs(volts).max():.1f} V")

# %%
import matplotlib.pyplot as plt  # noqa: E402

figure, axes = plt.subplots(figsize=(7, 2.4), layout="constrained")
axes.plot(np.arange(len(volts)) / wave.rate_hz, volts[:, 0], linewidth=0.5, color="black")
axes.set(title="The drive of the first row", xlabel="time, s", ylabel="volts")
plt.close(figure)  # once is enough: the next line shows it
figure  # noqa: B018

# %% [markdown]
# The same in numbers: the largest voltage of channel 0 in each twentieth of a second.

# %%
for start, part in enumerate(np.array_split(volts[:, 0], 10)):
    print(f"from {start / 20:.2f} s: up to {np.abs(part).max():5.2f} V")

# %% [markdown]
# Written to a file, the samples are what an amplifier plays, and the manifest beside them says what they are.

# %%
report = wave.write("hello.wav")
print(*report.files)

# %% [markdown]
# ## What is felt
#
# `verify` forgets the plan. It reads the two files, integrates every oscillator under the written samples, and reads
# the dots that stand out back as Braille.

# %%
felt = dw.verify("hello.wav")
print("right" if felt.ok else "not right", "-", felt.text)
print(np.array2string(felt.frames[0].amplitude, precision=2, suppress_small=True))

# %%
felt.figure()

# %% [markdown]
# The figure in words: `o` is a raised dot, `.` a flat one.

# %%
print(felt.words())

# %% [markdown]
# ## One chain alone
#
# Under all this stand solvers of one chain, which can be asked by themselves: how large does the last of six actuators
# get, around the resonance, when the coupling is near the damping?

# %%
one = dw.Chain(n=6, delta=5.3006e-3, beta=-1.0)
omega = np.linspace(0.99, 1.01, 9)
found = dw.sweep(one, epsilon=1e-4, lam=6.131e-3, omega=omega, tol=1e-6)
last = np.abs(np.asarray(found["phasor"]))[0, 0, :, -1]
for frequency, amplitude in zip(omega, last, strict=True):
    print(f"at {frequency:.4f} of the resonance: {amplitude:.5f}")
