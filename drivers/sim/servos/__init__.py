"""Simulated servos with control tables, byte-exact: registers, motion, load and heat, and their chains.

In: packets. Out: status packets. Imports base, packets, tables, sim.wire.
"""
