"""Mixes layers (sources of parameter values): expressions, gaze, idle motion, and the commands that control them.

In: commands and time. Out: one vector of parameters. Imports base to motion.
"""
