"""Other people's programs against the simulated buses, each in an environment of its own (``make clients``)."""
