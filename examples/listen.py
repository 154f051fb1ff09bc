"""listen.py DEPLOYMENT: prints the scans of a running deployment until they end."""

import sys
import time

from stillmap import Deployment
from stillmap_wire import Kind, SonarScan

scans = Deployment.named(sys.argv[1]).reader(SonarScan)
while True:
    message = scans.take()
    if message is None:
        time.sleep(0.01)
        continue
    header, scan = message
    if header.kind == Kind.END:
        print(f"the stream ends after scan {header.seq}", flush=True)
        break
    print(f"scan {header.seq}: x {scan.pose.x_m:.3f} m, y {scan.pose.y_m:.3f} m, {scan.count} readings", flush=True)
