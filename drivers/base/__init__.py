"""The contract of every servo bus, and what all drivers stand on: errors, clean-up, priority, telling.

In: nothing of the drivers. Out: the class ``Bus``, its servos, states and errors. Imports nothing of the drivers.
"""
