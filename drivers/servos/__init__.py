"""Shared core of drivers of servos with registers, for every protocol: transactions, start-up and telemetry.

In: goals in rad, a family's packets. Out: registers by short name, start-up and stop, states. Imports base to core.
"""
