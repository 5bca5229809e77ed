"""A recorded circle taken apart.

A file of positions, here made by numbers: a circle of 150 mm at 1000 mm/min whose axis Y has a scale that is 20 um/m
too long. The answer names the cause and gives it an interval.
"""

import numpy as np

import feedsim as fs

time = np.arange(0, 60, 0.01)  # s
angle = time * (1000 / 60) / 150  # rad
rows = np.column_stack((time, 150 * np.cos(angle), 150 * np.sin(angle) * (1 + 20e-6)))
np.savetxt("recorded.csv", rows, delimiter=",", header="time [s],X [mm],Y [mm]", comments="")
result = fs.circle("recorded.csv", "X,Y", radius="150 mm")
print(result.answers[0])
result.plot().save("recorded_circle.png")
