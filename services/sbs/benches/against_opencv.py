#!/usr/bin/env python3
"""Time and quality of SBS beside OpenCV's MOG2, in one run.

    against_opencv.py STILLMAP DATA [SEQUENCE ...]

STILLMAP is the command, DATA a folder of `NAME.frames.y4m` and `NAME.labels.y4m`. Each sequence is tried at its own size; one
320 wide also at twice that, and one 160 wide at no other. Rounds of both alternate, each on one thread, and the medians of
their times a frame are compared: what else the machine does slows both.

OpenCV is installed into a virtual environment in the user's cache the first time. It is needed for nothing else.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import venv

ROUNDS = 7
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "stillmap" / "opencv"


def with_opencv():
    """Goes on in an environment that has OpenCV."""
    try:
        import cv2  # noqa: F401
    except ImportError:
        python = CACHE / "bin" / "python"
        if not python.exists():
            venv.create(CACHE, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "numpy", "opencv-python-headless"], check=True)
        os.execv(python, [str(python), *sys.argv])


def read(path):
    """The frames of a mono Y4M."""
    import numpy

    data = path.read_bytes()
    header, _, body = data.partition(b"\n")
    width, height = (next(int(word[1:]) for word in header.split()[1:] if word[:1] == key) for key in (b"W", b"H"))
    frames = numpy.frombuffer(body, numpy.uint8).reshape(-1, len(b"FRAME\n") + width * height)
    return frames[:, len(b"FRAME\n") :].reshape(-1, height, width)


def write(path, frames):
    """A mono Y4M of frames."""
    height, width = frames[0].shape
    with path.open("wb") as file:
        file.write(b"YUV4MPEG2 W%d H%d F15:1 Ip Cmono\n" % (width, height))
        for frame in frames:
            file.write(b"FRAME\n" + frame.tobytes())


def mog2_ms(frames):
    """Median time a frame of MOG2 at its defaults, with shadows, as SBS has them."""
    import cv2
    import numpy

    subtractor, times = cv2.createBackgroundSubtractorMOG2(), []
    for frame in frames:
        begin = time.perf_counter()
        subtractor.apply(frame)
        times.append(time.perf_counter() - begin)
    return 1e3 * float(numpy.median(times))


def sbs(stillmap, frames, labels):
    """What `stillmap evaluate camera` says of a sequence."""
    command = [stillmap, "evaluate", "camera", frames, labels, "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def compare(stillmap, name, frames_file, labels_file):
    frames = read(frames_file)
    rounds = [(mog2_ms(frames), sbs(stillmap, frames_file, labels_file)) for _ in range(ROUNDS)]
    peer = sorted(ms for ms, _ in rounds)[ROUNDS // 2]
    ours = sorted(score["ms_per_frame"] for _, score in rounds)[ROUNDS // 2]
    score = rounds[0][1]
    size = f"{frames.shape[2]}x{frames.shape[1]}"
    print(f"{name:24} {size:>8} {ours:8.3f} {peer:8.3f} {ours / peer:7.2f} {score['f1']:7.3f} {score['false_blobs_per_frame']:7.3f}", flush=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    with_opencv()
    import cv2

    cv2.setNumThreads(1)
    stillmap, data = sys.argv[1], pathlib.Path(sys.argv[2])
    names = sys.argv[3:] or sorted(path.name.removesuffix(".frames.y4m") for path in data.glob("*.frames.y4m"))
    print(f"OpenCV {cv2.__version__}; ms a frame, the medians of {ROUNDS} rounds that alternate")
    print(f"{'sequence':24} {'size':>8} {'SBS':>8} {'MOG2':>8} {'ratio':>7} {'F1':>7} {'false':>7}")
    for name in names:
        files = [data / f"{name}.{kind}.y4m" for kind in ("frames", "labels")]
        compare(stillmap, name, *files)
        if read(files[0]).shape[2] == 320:
            with tempfile.TemporaryDirectory() as folder:
                larger = [pathlib.Path(folder) / file.name for file in files]
                for file, out, how in zip(files, larger, (cv2.INTER_LINEAR, cv2.INTER_NEAREST)):
                    write(out, [cv2.resize(frame, None, fx=2, fy=2, interpolation=how) for frame in read(file)])
                compare(stillmap, name, *larger)


if __name__ == "__main__":
    main()
