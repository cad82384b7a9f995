"""Robots that measure no torque: their drives' law, identified by simulating the commanded motion."""
