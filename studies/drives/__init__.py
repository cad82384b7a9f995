"""Robots without torque, simulated: how often intervals hold."""
