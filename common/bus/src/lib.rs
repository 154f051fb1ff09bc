//! The shell of every stillmap process, and the one home of iceoryx2.
