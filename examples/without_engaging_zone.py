"""Friction with and without the engaging zone.

Pure LuGre friction (W = 0) takes hold at once behind a reversal. With the transmission engaging model only a share of
the bristle stiffness acts there, and the glitch is lower and wider.
"""

import feedsim as fs

fs.example("xz_circle")
engaging = fs.run("xz_circle.yaml")
pure = fs.run("xz_circle.yaml", set={"machine.axes.*.friction.W": "0 rad"})
for name, result in (("engaging zone", engaging), ("pure LuGre", pure)):
    print(f"{name}: glitch of Z {result.figures['XZ.glitch_Z'].value:.2f} um")
fs.diff(engaging_zone=engaging, pure_LuGre=pure).pictures[0].save("without_engaging_zone.png")
