//! Everything on the bus into one MCAP log, and logs back into messages.
