"""Limits of speed, acceleration and jerk on every parameter.

In: wanted values and a time step. Out: values that may be shown. Imports base.
"""
