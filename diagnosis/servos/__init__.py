"""Diagnosis of robots without measured torque: their position in closed loop, simulated and measured."""
