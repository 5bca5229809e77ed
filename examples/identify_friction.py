"""Friction out of two logs.

Strokes at constant speed and sines are simulated and logged, with 2 % noise on the current. The identified curve stands
beside the plateaus of the log; its true values are known here.
"""

import feedsim as fs

logs = []
for motion in ("constant", "sine"):
    fs.example(f"identify_z_{motion}")
    fs.run(f"identify_z_{motion}.yaml", set={"logging.noise.i_q": "2 %"}, out=motion, force=True)
    logs.append(f"{motion}/log.csv")
result = fs.identify_friction(logs, "Z", "machines/test_centre")
print(result.answers[0])
result.plot().save("identify_friction.png")
