"""Ports: the operating system's serial devices, TCP, and what stands in the way of each.

In: a path or URL. Out: bytes in time, or an error that says what to type. Imports base.
"""
