"""Recordings of real robots: diagnosed by some of their runs, judged by another."""
