//! One message or picture to another process and one message back, by events: this crate beside bare iceoryx2 with a WaitSet,
//! in one run. A picture is copied into shared memory there, and only here it has a checksum.
//!
//! `cargo bench -p stillmap-bus --bench hop`; a hop of a message is half of what is shown.
#![expect(clippy::unwrap_used, reason = "a benchmark fails by panicking")]

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use criterion::{Criterion, criterion_group};
use iceoryx2::prelude::*;
use messages::{CameraFrame, FilterVerdict, FrameLayout, PixelFormat, SonarScan};
use stillmap_bus::{Domain, FrameReader, FrameWriter, Membership, Ports, Reader, Received, Writer};

const CHILD: &str = "STILLMAP_BENCH_CHILD";
/// As large as a scan.
type Bare = [u64; size_of::<SonarScan>() / 8];

fn main() {
    match std::env::var(CHILD).as_deref() {
        Ok("bus") => echo_bus(),
        Ok(prefix) if prefix.starts_with("pictures") => echo_bare_pictures(prefix),
        Ok(prefix) => echo_bare(prefix),
        Err(_) => {
            hops();
            Criterion::default().configure_from_args().final_summary();
        }
    }
}

criterion_group! { name = hops; config = Criterion::default().measurement_time(Duration::from_secs(5)); targets = bus_hop, bare_hop, bus_pictures, bare_pictures }

/// Sizes of grey pictures at 160 × 120, and of RGB pictures at 640 × 480.
const PICTURES: [FrameLayout; 2] = [
    FrameLayout { width: 160, height: 120, stride: 160, format: PixelFormat::Grey as u32 },
    FrameLayout { width: 640, height: 480, stride: 1920, format: PixelFormat::Rgb as u32 },
];

/// The other process; it ends when its standard input does.
fn child(role: &str, environment: &[(&'static str, std::ffi::OsString)]) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.env(CHILD, role).envs(environment.iter().map(|(key, value)| (key, value))).stdin(Stdio::piped());
    command.spawn().unwrap()
}

fn exit_with_parent() {
    std::thread::Builder::new()
        .name("parent-watch".into())
        .spawn(|| {
            let _ = std::io::read_to_string(std::io::stdin());
            std::process::exit(0);
        })
        .unwrap();
}

/// As the run loop waits.
fn wait(ports: &Ports) {
    ports.refresh();
    ports.wait(&[], Duration::from_secs(1)).unwrap();
}

fn bus_hop(criterion: &mut Criterion) {
    let domain = Domain::open(&format!("bench-hop-{}", std::process::id()), 1.0).unwrap();
    let mut other = child("bus", &domain.membership_for("echo", 0, "none".as_ref()).environment());
    let mut ports = Ports::join(&domain.membership_for("ping", 0, "none".as_ref())).unwrap();
    let mut scans: Writer<SonarScan> = ports.writer().unwrap();
    let mut verdicts: Reader<FilterVerdict> = ports.reader().unwrap();
    let scan = SonarScan::default();
    let mut seq = 0;
    let mut there_and_back = || {
        seq += 1;
        scans.send(seq, seq, &scan).unwrap();
        loop {
            match verdicts.take().unwrap() {
                Some(Received::Message(answer)) if answer.seq() == seq => return,
                Some(_) => (),
                None => wait(&ports),
            }
        }
    };
    there_and_back();
    criterion.bench_function("there and back, 672 bytes: stillmap-bus", |bencher| bencher.iter(&mut there_and_back));
    drop(other.stdin.take());
    other.wait().unwrap();
    drop((ports, scans, verdicts));
    domain.close().unwrap();
}

fn bus_pictures(criterion: &mut Criterion) {
    let domain = Domain::open(&format!("bench-pictures-{}", std::process::id()), 1.0).unwrap();
    let mut other = child("bus", &domain.membership_for("echo", 0, "none".as_ref()).environment());
    let mut ports = Ports::join(&domain.membership_for("ping", 0, "none".as_ref())).unwrap();
    let mut frames: FrameWriter<CameraFrame> = ports.frame_writer().unwrap();
    let mut verdicts: Reader<FilterVerdict> = ports.reader().unwrap();
    let mut seq = 0;
    for layout in PICTURES {
        let picture = vec![7; layout.bytes()];
        let mut there_and_back = || {
            seq += 1;
            frames.send(seq, seq, layout, &picture).unwrap();
            loop {
                match verdicts.take().unwrap() {
                    Some(Received::Message(answer)) if answer.seq() == seq => return,
                    Some(_) => (),
                    None => wait(&ports),
                }
            }
        };
        there_and_back();
        let name = format!("picture of {} bytes there, message back: stillmap-bus", layout.bytes());
        criterion.bench_function(&name, |bencher| bencher.iter(&mut there_and_back));
    }
    drop(other.stdin.take());
    other.wait().unwrap();
    drop((ports, frames, verdicts));
    domain.close().unwrap();
}

fn echo_bus() {
    exit_with_parent();
    let mut ports = Ports::join(&Membership::from_env().unwrap()).unwrap();
    let mut scans: Reader<SonarScan> = ports.reader().unwrap();
    let mut frames: FrameReader<CameraFrame> = ports.frame_reader().unwrap();
    let mut verdicts: Writer<FilterVerdict> = ports.writer().unwrap();
    loop {
        while let Some(Received::Message(scan)) = scans.take().unwrap() {
            verdicts.send(scan.seq(), scan.stamp_ns(), &FilterVerdict::default()).unwrap();
        }
        while let Some(Received::Message(frame)) = frames.take().unwrap() {
            verdicts.send(frame.seq(), frame.stamp_ns(), &FilterVerdict::default()).unwrap();
        }
        wait(&ports);
    }
}

/// Both directions of the bare connection; `there` and `back` are the names of services with an event of the same name.
struct BarePorts {
    publisher: iceoryx2::port::publisher::Publisher<ipc::Service, Bare, ()>,
    notifier: iceoryx2::port::notifier::Notifier<ipc::Service>,
    subscriber: iceoryx2::port::subscriber::Subscriber<ipc::Service, Bare, ()>,
    listener: iceoryx2::port::listener::Listener<ipc::Service>,
    _node: Node<ipc::Service>,
}

fn bare_ports(prefix: &str, out: &str, back: &str) -> BarePorts {
    let node = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>().unwrap();
    let name = |end: &str| format!("{prefix}/{end}").as_str().try_into().unwrap();
    let data = |end| node.service_builder(&name(end)).publish_subscribe::<Bare>().open_or_create().unwrap();
    let event = |end| node.service_builder(&name(end)).event().open_or_create().unwrap();
    BarePorts {
        publisher: data(out).publisher_builder().create().unwrap(),
        notifier: event(out).notifier_builder().create().unwrap(),
        subscriber: data(back).subscriber_builder().create().unwrap(),
        listener: event(back).listener_builder().create().unwrap(),
        _node: node,
    }
}

impl BarePorts {
    fn send(&self) {
        self.publisher.loan_uninit().unwrap().write_payload([0; size_of::<SonarScan>() / 8]).send().unwrap();
        self.notifier.notify().unwrap();
    }

    /// Waits by WaitSet until a message has come, and calls `then` for each.
    fn on_message(&self, mut then: impl FnMut() -> CallbackProgression) {
        let waitset = WaitSetBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>().unwrap();
        let _guard = waitset.attach_notification(&self.listener).unwrap();
        let arrived = |_| {
            self.listener.try_wait(|_| ()).unwrap();
            while self.subscriber.receive().unwrap().is_some() {
                if then() == CallbackProgression::Stop {
                    return CallbackProgression::Stop;
                }
            }
            CallbackProgression::Continue
        };
        waitset.wait_and_process(arrived).unwrap();
    }
}

fn bare_hop(criterion: &mut Criterion) {
    let prefix = format!("bench-hop-{}", std::process::id());
    let ports = bare_ports(&prefix, "there", "back");
    let mut other = child(&prefix, &[]);
    ports.on_message(|| CallbackProgression::Stop);
    let waitset = WaitSetBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>().unwrap();
    let _guard = waitset.attach_notification(&ports.listener).unwrap();
    criterion.bench_function("there and back, 672 bytes: bare iceoryx2, WaitSet", |bencher| {
        bencher.iter(|| {
            ports.send();
            let arrived = |_| {
                ports.listener.try_wait(|_| ()).unwrap();
                match ports.subscriber.receive().unwrap() {
                    Some(_) => CallbackProgression::Stop,
                    None => CallbackProgression::Continue,
                }
            };
            waitset.wait_and_process(arrived).unwrap();
        });
    });
    drop(other.stdin.take());
    other.wait().unwrap();
}

fn echo_bare(prefix: &str) {
    exit_with_parent();
    let ports = bare_ports(prefix, "back", "there");
    ports.send();
    ports.on_message(|| {
        ports.send();
        CallbackProgression::Continue
    });
}

/// Pictures one way, messages the other.
type Pictures = iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, [u8], ()>;
type Answers = iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, Bare, ()>;
type Event = iceoryx2::service::port_factory::event::PortFactory<ipc::Service>;

fn bare_services(prefix: &str) -> (Pictures, Event, Answers, Event, Node<ipc::Service>) {
    let node = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>().unwrap();
    let name = |end: &str| format!("{prefix}/{end}").as_str().try_into().unwrap();
    let event = |end: &str| node.service_builder(&name(end)).event().open_or_create().unwrap();
    (
        node.service_builder(&name("there")).publish_subscribe::<[u8]>().open_or_create().unwrap(),
        event("there"),
        node.service_builder(&name("back")).publish_subscribe::<Bare>().open_or_create().unwrap(),
        event("back"),
        node,
    )
}

fn bare_pictures(criterion: &mut Criterion) {
    let prefix = format!("pictures-{}", std::process::id());
    let (pictures, there, answers, back, _node) = bare_services(&prefix);
    let most = PICTURES.iter().map(FrameLayout::bytes).max().unwrap();
    let publisher = pictures.publisher_builder().initial_max_slice_len(most).create().unwrap();
    let notifier = there.notifier_builder().create().unwrap();
    let subscriber = answers.subscriber_builder().create().unwrap();
    let listener = back.listener_builder().create().unwrap();
    let mut other = child(&prefix, &[]);
    let waitset = WaitSetBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>().unwrap();
    let _guard = waitset.attach_notification(&listener).unwrap();
    let wait_for_answer = || {
        let arrived = |_| {
            listener.try_wait(|_| ()).unwrap();
            if subscriber.receive().unwrap().is_some() { CallbackProgression::Stop } else { CallbackProgression::Continue }
        };
        waitset.wait_and_process(arrived).unwrap();
    };
    wait_for_answer();
    for layout in PICTURES {
        let picture = vec![7; layout.bytes()];
        criterion.bench_function(&format!("picture of {} bytes there, message back: bare iceoryx2, WaitSet", layout.bytes()), |bencher| {
            bencher.iter(|| {
                publisher.loan_slice_uninit(picture.len()).unwrap().write_from_slice(&picture).send().unwrap();
                notifier.notify().unwrap();
                wait_for_answer();
            });
        });
    }
    drop(other.stdin.take());
    other.wait().unwrap();
}

fn echo_bare_pictures(prefix: &str) {
    exit_with_parent();
    let (pictures, there, answers, back, _node) = bare_services(prefix);
    let subscriber = pictures.subscriber_builder().create().unwrap();
    let listener = there.listener_builder().create().unwrap();
    let publisher = answers.publisher_builder().create().unwrap();
    let notifier = back.notifier_builder().create().unwrap();
    let send = || {
        publisher.loan_uninit().unwrap().write_payload([0; size_of::<SonarScan>() / 8]).send().unwrap();
        notifier.notify().unwrap();
    };
    send();
    let waitset = WaitSetBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>().unwrap();
    let _guard = waitset.attach_notification(&listener).unwrap();
    let arrived = |_| {
        listener.try_wait(|_| ()).unwrap();
        while subscriber.receive().unwrap().is_some() {
            send();
        }
        CallbackProgression::Continue
    };
    waitset.wait_and_process(arrived).unwrap();
}
