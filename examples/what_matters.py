"""Which friction parameter matters.

Thirty-two runs over four parameters of Z within 20 %, spread evenly. The bars are rank correlations with the peak where
Z reverses: 1 means that the peak rises with the parameter.
"""

from pathlib import Path

import matplotlib.pyplot as plt
from scipy.stats import spearmanr

import feedsim as fs

fs.example("xz_circle")
names = ("F_C", "F_S", "sigma_0", "W")
lines = "\n".join(
    f"  {name}: {{key: machine.axes.Z.friction.{name}, factor: true, distribution: uniform, from: 0.8, to: 1.2}}"
    for name in names
)
Path("spread.yaml").write_text(f"""
name: Friction of Z
scenario: xz_circle.yaml
set: {{motions.0.direction: counterclockwise, machine.axes.Z.friction.F_S: 2.6 N.m}}
sampling: {{method: latin_hypercube, runs: 32}}
parameters:
{lines}
""")
if __name__ == "__main__":  # workers are processes, which read this file, too
    table = fs.sweep("spread.yaml", "results/spread")
    done = table["status"] == "ok"
    found = [spearmanr(table[name][done], table["XZ.peak_Z"][done])[0] for name in names]
    for name, value in zip(names, found, strict=True):
        print(f"{name}: {value:.2f}")
    figure, axes = plt.subplots(figsize=(6, 4))
    axes.barh(names, found)
    axes.set(xlabel="rank correlation with the peak of Z", xlim=(-1, 1))
    figure.savefig("what_matters.png", dpi=100)
