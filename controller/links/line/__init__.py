"""Implements the line protocol: commands, sessions, serial and TCP links, scripts, and simulated robot hosts.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
