"""Tools that look at servos on a port without driving them: scanning, and changing an id.

In: a port. Out: findings. Imports any room left of it.
"""
