"""The whole machine in another simulator.

The machine with its motion as one FMU, run by FMPy at steps of 10 ms. The positions are those of `feedsim run`; the
extremes over a step show the overshoot all the same.
"""

import matplotlib.pyplot as plt
from fmpy import simulate_fmu

import feedsim as fs
from feedsim import cli

fs.example("z_positioning")
cli.main(["pack", "z_positioning.yaml", "--out", "machine.fmu", "--force"])
result = simulate_fmu("machine.fmu", stop_time=2.0, output_interval=10e-3, output=["Z.x_a", "Z.x_a_max"])
print(f"overshoot {1e6 * (result['Z.x_a_max'].max() - 0.2):.2f} um")
figure, axes = plt.subplots(figsize=(6, 4))
axes.plot(result["time"], 1e6 * (result["Z.x_a"] - 0.2), ".-", label="at the steps")
axes.plot(result["time"], 1e6 * (result["Z.x_a_max"] - 0.2), label="largest over a step")
axes.set(xlim=(1.35, 2), ylim=(-2, 4), xlabel="time [s]", ylabel="past the target [um]")
axes.legend()
figure.savefig("machine_in_fmpy.png", dpi=100)
