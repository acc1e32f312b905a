"""Heads in several processes: leases, payloads, following a conductor, and the Zenoh session that carries messages.

In: what a body mixed, messages of other processes. Out: messages, and what a body shows. Imports base to stage.
"""
