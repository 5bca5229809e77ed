"""Accuracy after ISO 230-2.

The axis goes to five targets, five times from either side. A simulated axis repeats itself to the last bit, so the
scenario adds what scatters.
"""

import feedsim as fs

fs.example("z_iso230_2")
result = fs.run("z_iso230_2.yaml")
for letter in "ARE":
    print(f"{letter} {result.figures[f'Z.{letter}'].value:.2f} um")
result.plot().save("acceptance.png")
