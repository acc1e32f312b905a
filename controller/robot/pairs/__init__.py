"""Learns mixes of channels from recorded pairs of parameters and angles of servos.

In: a table of pairs. Out: fitted terms, and a robot file with them. Imports base, and controller.robot.
"""
