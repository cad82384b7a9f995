"""Recordings of robots in any format: what a log is, how it is read, mapped and checked."""
