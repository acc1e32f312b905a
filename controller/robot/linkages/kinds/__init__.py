"""Contains one module for each kind of linkage, named ``KIND_linkage``, with its settings and geometry.

In: values of inputs. Out: degrees of servos. Imports base, the kinds' definition and the modules of kinds beside it.
"""
