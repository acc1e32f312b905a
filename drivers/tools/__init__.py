"""What looks at servos from outside a run: probing, giving ids.

In: a port. Out: findings. Imports any room left of it.
"""
