"""A frequency response of an axis that sticks.

Speed over torque is measured twice: without friction, and at rest with it. The bristles are a spring, so the axis at
rest seems heavier by far at low frequencies. Controls see the same.
"""

import matplotlib.pyplot as plt
import numpy as np

import feedsim as fs

fs.example("test_centre")
figure, axes = plt.subplots(figsize=(6, 4))
for friction in (False, True):
    found = fs.frf("machines/test_centre", axes=["Z"], friction=friction, tool=False)
    measured = found.measured
    low = np.interp(20, measured.frequency, np.abs(measured["Z.n_a/Z.M_a"]))
    print(f"{'with' if friction else 'without'} friction, at 20 Hz: {low:.3g} rad/s per N.m")
    axes.loglog(measured.frequency, np.abs(measured["Z.n_a/Z.M_a"]), label="with friction" if friction else "without")
axes.set(xlabel="frequency [Hz]", ylabel="n/M [rad/s/(N.m)]")
axes.legend()
figure.savefig("stiction_in_the_response.png", dpi=100)
