"""Simulated boards: Maestro, SSC-32, boards that read lines.

In: bytes. Out: answers, and pulses that move to their targets. Imports base, the families' protocols, sim.wire.
"""
