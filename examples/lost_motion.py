"""Play between motor and slide.

X is measured at its motor, and has 8 um of play. The circle has a step wherever X reverses, which stays for half a
turn: lost motion.
"""

import feedsim as fs

fs.example("xz_circle")
play = {"machine.axes.X.play": "8 um", "machine.axes.X.drive.measuring.indirect": "true"}
result = fs.run("xz_circle.yaml", set=play)
print(f"lost motion of X {result.figures['XZ.lost_motion_X'].value:.1f} um")
result.plot().save("lost_motion.png")
