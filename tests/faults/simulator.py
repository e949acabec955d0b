"""A deterministic simulator: quick, sometimes with long arrays, sometimes failing."""

import json
import sys
import time

given = json.load(sys.stdin)
angle, width = given["x"]["angle"], given["x"]["width"]
time.sleep(0.05)  # so that a kill finds it at work
if angle > 55.0:
    sys.exit(f"angle = {angle:g} deg is too steep")
f = (angle - 31.0) ** 2 / 100.0 + (width - 0.08) ** 2 * 1e3 + 0.01 * (given["seed"] % 7)
course = [f / (n + 1) for n in range(2000 if given["level"] == "fine" else 5)]
json.dump({"f": f, "course": course, "work": 10.0}, sys.stdout)
