//! What a session is told, and what it wants done.

use crate::checkpoint::Checkpoint;
use crate::command::Command;
use crate::event::Event;

/// What happens to a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input<'a> {
    /// The port is there, at [`Session::baud`](crate::Session::baud).
    Opened,
    /// Bytes from the robot.
    Bytes(&'a [u8]),
    /// The data of a packet with which another program, on the shared port, commands the robot.
    Client(&'a [u8]),
    /// That program has left.
    ClientLeft,
    /// Time has passed; wanted by [`Session::due_ns`](crate::Session::due_ns) at the latest.
    Tick,
    /// The port is gone.
    Vanished,
    /// The driver ends.
    Stop,
}

/// What a session wants done, in this order.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Send this to the robot.
    Send(Command),
    /// Send this packet of another program to the robot, unchanged.
    Forward(Vec<u8>),
    /// Set the line to this baud rate and drop what waits to be read.
    Baud(u32),
    /// Drop what waits to be read.
    Flush,
    /// Close the port and open it again.
    Reopen,
    /// Keep this, then publish its scan.
    Publish(Box<Checkpoint>),
    /// Something to say.
    Event(Event),
}
