"""A machine with one axis.

A table on a granite base, of 40 kg, driven by a ball screw of 10 mm pitch. Its machine and structure files are short
enough to begin a machine of your own with.
"""

import feedsim as fs

fs.example("one_axis")
result = fs.run("one_axis.yaml")
print(f"overshoot {result.figures['X.overshoot'].value:.2f} um")
result.plot().save("one_axis.png")
