"""Modes that move with the axis.

The first elastic modes of the default machine at six positions of Z, computed from its structure file. Where the ram
reaches out, its modes fall; one pose holds for short moves only.
"""

import matplotlib.pyplot as plt

import feedsim as fs

fs.example("test_centre")
positions = [0, 0.1, 0.25, 0.4, 0.55, 0.685]  # m
figure, axes = plt.subplots(figsize=(6, 4))
for z in positions:
    found = fs.machine_info("machines/test_centre", at={"Z": z})
    frequencies = [mode for mode in found.info.modes.frequency if 1 < mode < 200]
    print(f"Z {1e3 * z:.0f} mm: {len(frequencies)} modes below 200 Hz, the first at {frequencies[0]:.1f} Hz")
    axes.plot([1e3 * z] * len(frequencies), frequencies, "_", color="tab:blue", markersize=14)
axes.set(xlabel="position of Z [mm]", ylabel="frequency [Hz]")
figure.savefig("modes_over_the_travel.png", dpi=100)
