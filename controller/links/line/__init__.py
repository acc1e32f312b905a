"""Implements the line protocol: commands, sessions, the serial port, scripts, simulated hosts.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
