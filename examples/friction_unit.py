"""The friction unit alone.

The speed swings to and fro by 5 rad/s. Torque over speed is a loop: behind each reversal the bristles have to bend to
the other side first.
"""

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

from feedsim.foundation.installation import shipped

time = np.linspace(0, 2, 4001)
speed = np.rec.fromarrays((time, 5 * np.sin(2 * np.pi * time)), names="time,n_fr")
result = simulate_fmu(
    shipped("fmus") / "friction.fmu", stop_time=2.0, output_interval=0.5e-3, input=speed, output=["n_fr", "M_fr"]
)
print(f"largest torque {result['M_fr'].max():.2f} N.m")
figure, axes = plt.subplots(figsize=(6, 4))
axes.plot(result["n_fr"][2000:], result["M_fr"][2000:])
axes.set(xlabel="speed [rad/s]", ylabel="friction torque [N.m]")
figure.savefig("friction_unit.png", dpi=100)
