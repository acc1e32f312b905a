"""What every room of the controller stands on: errors, files, settings, parameters, clocks, mailboxes.

In: files a user edits. Out: checked settings, and errors that say where and what to type. Imports no other room of it.
"""
