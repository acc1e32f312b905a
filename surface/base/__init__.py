"""What every other room of the surface stands on: errors, progress, checks of arguments, how kernels are compiled.

In: arguments of callers. Out: checked arrays, errors that say what to do. Imports nothing of the surface.
"""
