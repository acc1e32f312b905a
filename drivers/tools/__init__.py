"""Tools for servos on a port that is not being driven: scanning, and changing an id.

In: a port. Out: findings. Imports any room left of it.
"""
