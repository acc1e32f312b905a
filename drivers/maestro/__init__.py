"""Driver of Pololu Maestro boards.

In: goals in rad. Out: pulse targets. Imports base to boards.
"""
