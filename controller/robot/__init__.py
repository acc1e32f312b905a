"""Servo heads: robot files, channels from parameters to angles, safety rules, bus loops, the mirror back.

In: parameters. Out: goals for the drivers; measured positions come back. Imports base to layers, and drivers.
"""
