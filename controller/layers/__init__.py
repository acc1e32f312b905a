"""Mixes sources of values in layers: expressions, gaze, idle motion, and the commands that control them.

In: commands and time. Out: one vector of parameters. Imports base to motion.
"""
