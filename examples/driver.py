"""driver.py FILE: a driver in Python, which publishes robot/scan from a text file with one scan per line.

A line holds the time in s; x, y (m) and yaw (rad) of the robot; then for each reading x, y (m) and heading (rad) of its sonar on the
robot, and the range in m. Its deployment:

    [[process]]
    name = "driver"
    command = ["python3", "examples/driver.py", "scans.txt"]
    ends_run = true
"""

import sys
import time

from stillmap import Deployment
from stillmap_wire import Pose, SonarReading, SonarScan

lines = [[float(word) for word in line.split()] for line in open(sys.argv[1])]
deployment = Deployment.from_env()
scans = deployment.writer(SonarScan)
# Scans are numbered from 1. After a restart they are published again with the same numbers: readers drop those they have received.
numbered = enumerate(lines, 1)
last = (0, 0)


def step():
    global last
    seq, line = next(numbered, (0, None))
    if line is None or deployment.stopping:
        scans.end(*last)
        return False
    scan = SonarScan(pose=Pose(*line[1:4]), count=len(line[4:]) // 4)
    for sonar, (x, y, heading, range_m) in enumerate(zip(*[iter(line[4:])] * 4)):
        scan.readings[sonar] = SonarReading(Pose(x, y, heading), range_m, sonar, range_m < 3.0)
    last = (seq, int(line[0] * 1e9))
    scans.send(*last, scan)
    time.sleep(0.01)
    return True


deployment.run(step)
