"""Feetech STS, SMS and SCS servos.

In: goals in rad. Out: sync writes, and states read together or one by one. Imports base to protocol1.
"""
