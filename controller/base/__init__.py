"""Provides what all rooms of the controller use: errors, files, settings, parameters, clocks, mailboxes.

In: files a user edits. Out: checked settings, and errors with their place. Imports no other sub-room.
"""
