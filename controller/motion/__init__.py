"""Limits speed, acceleration and jerk of every parameter.

In: wanted values and a time step. Out: values that may be shown. Imports base.
"""
