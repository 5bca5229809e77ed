"""Friction at the guide instead of the motor.

The sum of friction stays; 60 % of that of X goes to the guide, where the scale is. The screw between motor and guide
has to be wound up at a reversal, so the peaks of X are larger.
"""

import feedsim as fs

fs.example("xz_circle")
motor = fs.run("xz_circle.yaml")
guide = fs.run("xz_circle.yaml", set={"machine.axes.X.guide.share": "60 %"})
for name, result in (("motor", motor), ("guide", guide)):
    print(f"{name}: peak of X {result.figures['XZ.peak_X'].value:.2f} um")
fs.diff(motor=motor, guide=guide).pictures[0].save("friction_at_the_guide.png")
