"""Simulated far ends served to any program: by pseudo-terminal, TCP or in the same process.

In: what is on the wire, faults. Out: a port. Imports any room left of it.
"""
