"""Serial ports: devices of the operating system, TCP and sockets in this process; listing of those plugged in.

In: a path or URL. Out: bytes by a deadline, or an error with the command that fixes it. Imports base.
"""
