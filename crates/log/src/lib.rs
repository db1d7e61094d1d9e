//! The record of a run: topics, messages and the MCAP file that holds them.
