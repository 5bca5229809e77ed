"""A higher position gain, and what it buys.

K_v says how hard an axis is pulled back to its setpoint. The glitch falls with it, but not in proportion: most of the
torque comes from the speed controller.
"""

import feedsim as fs

fs.example("xz_circle")
results = {
    f"K_v = {gain}": fs.run("xz_circle.yaml", set={"machine.axes.*.drive.K_v": f"{gain} (m/min)/mm"})
    for gain in (2, 4, 6)
}
for name, result in results.items():
    print(f"{name}: glitch of Z {result.figures['XZ.glitch_Z'].value:.2f} um")
fs.diff(**results).pictures[0].save("position_gain.png")
