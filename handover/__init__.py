"""Robots that hand objects over, as Functional Mock-up Units, and the master that co-simulates them.

The five parts are folders beside this one; here are links to them, so that all is imported under this one name.
"""
