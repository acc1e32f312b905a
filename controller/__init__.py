"""Controls the face: from commands over links and panels to the picture and the servos; and the command line.

In: commands, takes, voices and files. Out: parameters, that the surface shows and the drivers send. Imports surface and
drivers; its rooms import each other in the order of pyproject.toml only.
"""
