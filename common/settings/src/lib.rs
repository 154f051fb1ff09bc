//! Typed configuration of a stillmap deployment: parse, validate, explain.
