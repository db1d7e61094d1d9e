//! Errors of poses and rates of outcomes: pure functions of estimates and truth.
