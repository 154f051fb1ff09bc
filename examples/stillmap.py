"""A process of a stillmap deployment in Python: joins the bus, sends and receives messages, sends heartbeats.

Needs iceoryx2's package (pip install iceoryx2) and stillmap_wire.py beside it. It carries messages, not pictures.
docs/wire.md has the rules that a driver follows; driver.py is a driver, listen.py a listener.
"""

import os
import signal
import time
import zlib
from pathlib import Path

import iceoryx2 as iox

from stillmap_wire import Header, Heartbeat, Kind, Phase

HEARTBEAT_S = 0.2
# Time for readers to take the last messages, whose memory is lost with this process.
LINGER_S = 0.5


class Deployment:
    """The place of this process in a deployment."""

    def __init__(self, folder, process, run=None, clock=(0, 0, 1.0), routed=()):
        """Joins the deployment whose runtime folder this is."""
        self.process, self.run_number, self.clock, self.routed = process, run, clock, routed
        self.stopping, self.sent, self.rounds, self.writers = False, 0, 0, []
        config = iox.config.default()
        config.global_cfg.prefix = iox.FileName.new(f"stillmap_{zlib.crc32(os.fsencode(folder)):08x}_")
        config.global_cfg.root_path = iox.Path.new(f"{folder}/bus")
        # Only the supervisor cleans up.
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        node = iox.NodeBuilder.new().name(iox.NodeName.new(process)).config(config)
        self.node = node.signal_handling_mode(iox.SignalHandlingMode.Disabled).create(iox.ServiceType.Ipc)

    @classmethod
    def from_env(cls):
        """Joins the deployment of the supervisor that has started this process."""
        if "STILLMAP_DOMAIN" not in os.environ:
            raise SystemExit("STILLMAP_DOMAIN is not set: this process is started by `stillmap run`, not by hand")
        monotonic_ns, real_ns, speed = os.environ["STILLMAP_CLOCK"].split(":")
        clock = (int(monotonic_ns), int(real_ns), float(speed))
        routed = os.environ["STILLMAP_ROUTE"].split(",")
        run = int(os.environ["STILLMAP_RUN"], 16)
        self = cls(os.environ["STILLMAP_DOMAIN"], os.environ["STILLMAP_PROCESS"], run, clock, routed)
        # The supervisor stops a process with SIGTERM. Ctrl-C reaches every process of a terminal: the supervisor decides.
        signal.signal(signal.SIGTERM, lambda *_: setattr(self, "stopping", True))
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self.heartbeats = self._writer(Heartbeat)
        self._beat(Phase.STARTING)
        return self

    @classmethod
    def named(cls, name, process="listener"):
        """Joins the running deployment of this name as an observer."""
        environment = os.environ
        runtime = environment.get("STILLMAP_RUNTIME_DIR")
        if not runtime and environment.get("XDG_RUNTIME_DIR"):
            runtime = f"{environment['XDG_RUNTIME_DIR']}/stillmap"
        folder = Path(runtime or f"/tmp/stillmap-{os.getuid()}") / name
        if not (folder / "bus").is_dir():
            raise SystemExit(f"no deployment {name} is running")
        return cls(str(folder), process)

    def now_ns(self):
        """Sensor time for drivers."""
        monotonic_ns, real_ns, speed = self.clock
        return real_ns + int((time.clock_gettime_ns(time.CLOCK_MONOTONIC) - monotonic_ns) * speed)

    def writer(self, payload):
        """An output: payload is a class of stillmap_wire with a SERVICE."""
        self.writers.append(self._writer(payload, self))
        return self.writers[-1]

    def reader(self, payload):
        """An input."""
        return Reader(self._open(payload, payload.SERVICE))

    def run(self, step):
        """Calls step until it returns False, sends heartbeats, and lets readers take the last messages. It returns within a heartbeat's time."""
        self._beat(Phase.RUNNING)
        beaten = time.monotonic()
        while step():
            self.rounds += 1
            if time.monotonic() - beaten >= HEARTBEAT_S:
                self._beat(Phase.RUNNING)
                beaten = time.monotonic()
        self._beat(Phase.ENDING)
        time.sleep(LINGER_S)

    def _beat(self, phase):
        heartbeat = Heartbeat(process=self.process.encode(), progress=self.rounds, sent=self.sent, pid=os.getpid(), phase=phase)
        self.heartbeats.send(self.rounds, self.now_ns(), heartbeat)
        # Readers that have joined receive the history.
        for writer in self.writers:
            writer.publisher.update_connections()

    def _open(self, payload, name):
        """Opens a service. Another version of its contract is refused."""
        builder = self.node.service_builder(iox.ServiceName.new(name)).publish_subscribe(payload).user_header(Header)
        contract = iox.AttributeVerifier.new().require(iox.AttributeKey.new("contract"), iox.AttributeValue.new(payload.CONTRACT))
        return builder.open_with_attributes(contract)

    def _writer(self, payload, counted=None):
        name = f"{payload.SERVICE}~tapped" if payload.SERVICE in self.routed else payload.SERVICE
        event = self.node.service_builder(iox.ServiceName.new(name)).event().open() if payload.WAKES else None
        return Writer(payload, self._open(payload, name), event, self.run_number, counted)


class Writer:
    """An output of a process."""

    def __init__(self, payload, service, event, run, counted):
        self.payload, self.run, self.counted = payload, run, counted
        self.publisher = service.publisher_builder().create()
        self.notifier = event.notifier_builder().create() if event else None

    def send(self, seq, stamp_ns, payload):
        """Sends a message with its number in the stream and its sensor time."""
        self._send(Header(run=self.run, seq=seq, stamp_ns=stamp_ns, kind=Kind.DATA), payload)

    def end(self, seq, stamp_ns):
        """Publishes that the stream ends after message seq."""
        self._send(Header(run=self.run, seq=seq, stamp_ns=stamp_ns, kind=Kind.END), self.payload())

    def _send(self, header, payload):
        header.crc32 = zlib.crc32(bytes(header) + bytes(payload))
        sample = self.publisher.loan_uninit()
        sample.user_header()[0] = header
        sample.write_payload(payload).send()
        if self.notifier:
            self.notifier.notify()
        if self.counted:
            self.counted.sent += 1


class Reader:
    """An input of a process."""

    def __init__(self, service):
        self.subscriber = service.subscriber_builder().create()

    def take(self):
        """The header and the payload of the next message; None if none waits. A message with a wrong checksum is an error."""
        sample = self.subscriber.receive()
        if sample is None:
            return None
        header, payload = Header.from_buffer_copy(sample.user_header()[0]), type(sample.payload()[0]).from_buffer_copy(sample.payload()[0])
        sample.delete()
        found, header.crc32 = header.crc32, 0
        if found != zlib.crc32(bytes(header) + bytes(payload)):
            raise ValueError(f"message {header.seq} has a wrong checksum")
        return header, payload
