//! Seeded dives over a virtual production system: rendered images or noisy points, with truth.
