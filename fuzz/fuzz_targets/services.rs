//! Any bytes as the payload or the header of a picture of any service: rejected, or written to a log and read from it as valid.
#![no_main]

use std::convert::Infallible;

use drivelog::{LogVisitor, Logged, visit_logged};
use libfuzzer_sys::fuzz_target;
use messages::{FrameLayout, Pictures};

struct Input<'a> {
    /// The service that the bytes are taken for, by its place in the registry.
    service: usize,
    visited: usize,
    bytes: &'a [u8],
}

impl Input<'_> {
    fn is_next(&mut self) -> bool {
        self.visited += 1;
        self.visited == self.service + 1
    }

    /// The bytes as a value of this type; those that are missing are zero.
    fn read<T: bytemuck::Pod>(&self) -> T {
        let mut value = T::zeroed();
        bytemuck::bytes_of_mut(&mut value).iter_mut().zip(self.bytes).for_each(|(to, from)| *to = *from);
        value
    }
}

impl LogVisitor for Input<'_> {
    type Error = Infallible;

    fn message<T: Logged>(&mut self) -> Result<(), Infallible> {
        if self.is_next() {
            let payload: T = self.read();
            if payload.validate().is_ok() {
                let (seq, found) = T::decode(&payload.encode(7, 8)).unwrap();
                assert_eq!(seq, 7, "{}", T::SERVICE.name);
                found.validate().unwrap();
            }
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        if self.is_next() {
            let layout: FrameLayout = self.read();
            if layout.validate(P::MAX_BYTES).is_ok() {
                assert!(layout.bytes() <= P::MAX_BYTES, "{}", P::SERVICE.name);
            }
        }
        Ok(())
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some((service, bytes)) = bytes.split_first() else { return };
    let Ok(()) = visit_logged(&mut Input { service: usize::from(*service) % messages::SERVICES.len(), visited: 0, bytes });
});
