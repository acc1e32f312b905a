"""Provides what all folders of the controller use: errors, files, settings, parameters, clocks, mailboxes.

In: files that a user edits. Out: checked settings, and errors with their key. Imports no other folder of controller.
"""
