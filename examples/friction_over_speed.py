"""The friction law over speed.

The torque at constant speed is a closed form: it falls from the static to the Coulomb friction, then rises with the
logarithmic and the viscous part. The dot is the least torque: below its speed an axis can stick and slip.
"""

import matplotlib.pyplot as plt
import numpy as np

import feedsim as fs

fs.example("test_centre")
friction = fs.load_machine("machines/test_centre").axes["Z"].friction
speed = np.geomspace(1e-3, 100, 400)  # rad/s
peak = (friction.F_S - friction.F_C) * np.exp(-((speed / friction.v_s) ** friction.beta))
torque = friction.F_C + peak + friction.F_log * np.log(speed / friction.v_log + 1) + friction.sigma_2 * speed
least = speed[np.argmin(torque)]
print(f"least torque {torque.min():.2f} N.m at {least:.2f} rad/s")
figure, axes = plt.subplots(figsize=(6, 4))
axes.semilogx(speed, torque)
axes.plot(least, torque.min(), "o")
axes.set(xlabel="speed of the motor [rad/s]", ylabel="friction torque [N.m]")
figure.savefig("friction_over_speed.png", dpi=100)
