"""Identification of robots that measure no torque: simulate the servo loop, and fit its position."""
