"""Tools for tests of other programs: pytest fixtures, whole simulated robots, simulated robot hosts.

In: models and ids, robot files, scripts. Out: ports, records, assertions. Imports any other folder of controller.

:mod:`controller.testing.plugin` is loaded by every run of pytest where omote is installed, so neither it nor this
module imports anything of omote before a fixture is used.
"""
