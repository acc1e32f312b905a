"""Sources of values and how they are mixed: layers, acting, gaze, idle life, and the commands that steer them.

In: commands and time. Out: one vector of parameters. Imports base to motion.
"""
