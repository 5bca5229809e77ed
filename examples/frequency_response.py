"""The speed-controlled system of Z.

Speed over torque of the motor, in closed form. Below the first mode it is an inertia, above it has the resonances of
structure and drive train. The dashed line is the rigid axis.
"""

import matplotlib.pyplot as plt
import numpy as np

import feedsim as fs

fs.example("test_centre")
response = fs.frf("machines/test_centre", axes=["Z"])
frequency, magnitude = response.frequency, np.abs(response["Z.n_a/Z.M_a"])
print(f"n/M at 10 Hz: {np.interp(10, frequency, magnitude):.2f} rad/s per N.m")
figure, axes = plt.subplots(figsize=(6, 4))
axes.loglog(frequency, magnitude)
axes.loglog(frequency, magnitude[0] * frequency[0] / frequency, "--")
axes.set(xlabel="frequency [Hz]", ylabel="n/M [rad/s/(N.m)]")
figure.savefig("frequency_response.png", dpi=100)
