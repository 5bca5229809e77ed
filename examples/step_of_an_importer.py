"""The step of another simulator does not matter.

The machine as one unit is stepped by FMPy, at 125 us and at 10 ms. At common instants nothing differs, to the last bit:
the drives keep their own cycle inside.
"""

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import feedsim as fs

fs.example("z_positioning")
fs.export("z_positioning.yaml", "machine.fmu", force=True)
figure, axes = plt.subplots(figsize=(6, 4))
found = {}
for step, style in ((125e-6, "-"), (10e-3, "o")):
    found[step] = simulate_fmu("machine.fmu", step_size=step, output_interval=step, output=["Z.x_a", "Z.motion.x_s"])
    error = 1e6 * (found[step]["Z.x_a"] - found[step]["Z.motion.x_s"][-1])
    axes.plot(found[step]["time"], error, style, markersize=3, label=f"{1e3 * step:g} ms")
common = found[125e-6]["Z.x_a"][::80][: len(found[10e-3])]
print(f"largest difference {np.abs(common - found[10e-3]['Z.x_a'][: len(common)]).max():g} m")
axes.set(xlabel="time [s]", ylabel="distance from the target [um]", ylim=(-4, 4))
axes.legend()
figure.savefig("step_of_an_importer.png", dpi=100)
