"""Test bench for other people's robots: pytest's fixtures, whole simulated heads, simulated robot hosts.

In: models and ids, robot files, scripts. Out: ports, records, assertions. Imports any room of the controller before it.

:mod:`controller.testing.plugin` is loaded by every run of pytest where omote is installed, so neither it nor this
module imports anything of omote before a fixture is used.
"""
