"""The interface of every servo bus, and what all drivers share: errors, plug-ins, clean-up, scheduling, logging.

In: nothing of the drivers. Out: the class ``Bus``, its servos, states and errors. Imports nothing of the drivers.
"""
