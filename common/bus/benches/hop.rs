//! One message to another process and one back, by events: this crate beside bare iceoryx2 with a WaitSet, in one run.
//!
//! `cargo bench -p stillmap-bus --bench hop`; a hop is half of what is shown.
#![expect(clippy::unwrap_used, reason = "a benchmark fails by panicking")]

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use criterion::{Criterion, criterion_group};
use iceoryx2::prelude::*;
use messages::{FilterVerdict, SonarScan};
use stillmap_bus::{Domain, Membership, Reader, Received, Shell, Writer};

const CHILD: &str = "STILLMAP_BENCH_CHILD";
/// As large as a scan.
type Bare = [u64; size_of::<SonarScan>() / 8];

fn main() {
    match std::env::var(CHILD).as_deref() {
        Ok("bus") => echo_bus(),
        Ok(prefix) => echo_bare(prefix),
        Err(_) => {
            hops();
            Criterion::default().configure_from_args().final_summary();
        }
    }
}

criterion_group! { name = hops; config = Criterion::default().measurement_time(Duration::from_secs(5)); targets = bus_hop, bare_hop }

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

fn bus_hop(criterion: &mut Criterion) {
    let domain = Domain::open(&format!("bench-hop-{}", std::process::id()), 1.0).unwrap();
    let mut other = child("bus", &domain.membership_for("echo", 0, "none".as_ref()).environment());
    let mut shell = Shell::join(domain.membership_for("ping", 0, "none".as_ref())).unwrap();
    let mut scans: Writer<SonarScan> = shell.writer().unwrap();
    let mut verdicts: Reader<FilterVerdict> = shell.reader().unwrap();
    let scan = SonarScan::default();
    let mut seq = 0;
    let mut there_and_back = || {
        seq += 1;
        scans.send(seq, seq, &scan).unwrap();
        loop {
            match verdicts.take().unwrap() {
                Some(Received::Message(answer)) if answer.seq() == seq => return,
                Some(_) => (),
                None => shell.wait_for_inputs(Duration::from_secs(1)).unwrap(),
            }
        }
    };
    there_and_back();
    criterion.bench_function("there and back, 672 bytes: stillmap-bus", |bencher| bencher.iter(&mut there_and_back));
    drop(other.stdin.take());
    other.wait().unwrap();
    drop((shell, scans, verdicts));
    domain.close().unwrap();
}

fn echo_bus() {
    exit_with_parent();
    let mut shell = Shell::join(Membership::from_env().unwrap()).unwrap();
    let mut scans: Reader<SonarScan> = shell.reader().unwrap();
    let mut verdicts: Writer<FilterVerdict> = shell.writer().unwrap();
    loop {
        while let Some(Received::Message(scan)) = scans.take().unwrap() {
            verdicts.send(scan.seq(), scan.stamp_ns(), &FilterVerdict::default()).unwrap();
        }
        shell.wait_for_inputs(Duration::from_secs(1)).unwrap();
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
