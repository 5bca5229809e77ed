"""A stop with less jerk.

A move of 100 mm on Z shakes the bed, which rings at 21 Hz. With 60 in place of 150 m/s^3 the overshoot falls by more
than a half, and the axis is at rest earlier.
"""

import feedsim as fs

fs.example("z_positioning")
hard = fs.run("z_positioning.yaml")
soft = fs.run("z_positioning.yaml", set={"machine.path.jerk": "60 m/s^3"})
for name, result in (("150 m/s^3", hard), ("60 m/s^3", soft)):
    figures = result.figures
    print(f"{name}: {figures['Z.overshoot'].value:.2f} um, {figures['Z.settling_time'].value:.0f} ms")
fs.diff(hard=hard, soft=soft).pictures[0].save("soft_stop.png")
